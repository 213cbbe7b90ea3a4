"""The tracker as a process: blobs in, tracks out."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import ExitStack

import cv2

from heel.schemas import (
    Blobs,
    EndOfStream,
    FrameId,
    HeelError,
    MessageError,
    SettingsError,
    Snapshot,
    TrackEvent,
    Tracks,
    keys,
)
from heel.services.runtime import qos
from heel.services.runtime.chain import STANDBY, WITHHELD
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.publishing import StreamPublisher
from heel.services.runtime.service import ServiceContext, run_service
from heel.services.runtime.settings import Loaded
from heel.services.runtime.state_file import StateFile
from heel.services.runtime.streams import Received, StreamJudge
from heel.services.runtime.succession import (
    Line,
    SnapshotQuestion,
    StandingBy,
    Succession,
    leads_already,
)
from heel.services.tracker.core import configured, warm_up
from heel.services.tracker.depth_input import DepthInput
from heel.services.tracker.settings import TrackerServiceSettings
from heel.services.tracker.shadow import Shadow
from heel.services.tracker.story import sentence
from heel.services.tracker.trace import Event, Trace
from heel.services.tracker.trace_file import TraceFile

_log = logging.getLogger("heel.tracker")
PUBLISHED = frozenset({
    "contact", "unsure", "sure", "decided", "assigned", "returned", "re-identified", "given up",
    "verifying", "verified",
})  # fmt: skip
"""Events that are published: those from which it shows whether an id is still on its person."""
_MOST_PER_S = 5.0
"""Events published a second, over some seconds; chosen by hand: more are not read."""
_MOST_AT_ONCE = 20
"""Events published at once after a quiet time; chosen by hand: a group that parts."""
_TRIAL_FRAMES = 25
"""Frames in which a state that was left has to prove that it can be worked with; chosen by hand."""
_MOST_UNANSWERED = 2
"""Frames answered at the moment of taking over: older ones are of no use to anybody, as many wait
at any receiver."""
_TURN_S = 0.05
"""Longest wait [s] of a tracker that stands by before it looks whether to take over."""


class Events:
    """Publishes what becomes of identities, a few a second at most; what is more is left out."""

    def __init__(self, send: Callable[[TrackEvent], None]) -> None:
        """Publish by `send`, once there is a frame."""
        self._send = send
        self._frame: FrameId | None = None
        self._left = float(_MOST_AT_ONCE)
        self._filled_s = 0.0

    def begin(self, frame: FrameId, now_s: float) -> None:
        """From here on events are of this frame."""
        self._frame = frame
        more = (now_s - self._filled_s) * _MOST_PER_S
        self._left = min(self._left + more, _MOST_AT_ONCE)
        self._filled_s = now_s

    def take(self, event: Event) -> None:
        """Publish an event, if it is one of those and there is room."""
        ids = tuple(one for one in (event.id, event.other) if one)
        if event.kind not in PUBLISHED or not ids or self._frame is None or self._left < 1.0:
            return
        self._left -= 1.0
        text = sentence(event)
        self._send(TrackEvent(frame=self._frame, kind=event.kind, ids=ids, text=text[:300]))


def log_identities(event: Event) -> None:
    """Log a change of who is who; the log's own guard bounds how many a second."""
    if event.kind in ("given up", "re-identified") or event.outcome in ("exchanged", "refuted"):
        _log.info("%s", sentence(event), extra={"frame": event.frame})


def serve(context: ServiceContext[TrackerServiceSettings]) -> None:
    """Track until the stream ends or the service is stopped."""
    warm_up()
    with ExitStack() as stack:
        trace = Trace(log_identities)
        if context.settings.trace is not None:
            trace.add(stack.enter_context(TraceFile(context.settings.trace)).take)
        TrackerService(context, trace, stack).run()


class TrackerService:
    """Wires the tracker core to its topics, and to the trackers that stand by."""

    def __init__(
        self, context: ServiceContext[TrackerServiceSettings], trace: Trace, resources: ExitStack
    ) -> None:
        self._context = context
        camera, live = context.settings.camera, context.settings.delivery == "live"
        # Nothing waits for them, not even in a lossless run.
        self._events_out = StreamPublisher(
            context.session, keys.events(camera), qos.EVENTS, "live", context.producer
        )  # fmt: skip
        self._events = Events(lambda event: self._events_out.send(event, 0.0))
        self._trace = trace
        trace.add(self._events.take)
        self._tracker = configured(context.settings, trace)
        self._blobs = context.subscribe("blobs", keys.blobs(camera), qos.BLOBS)
        self._others: StreamJudge | None = None
        self._out = context.publisher(keys.tracks(camera), qos.TRACKS)
        self._newest: FrameId | None = None
        self._on_trial = 0
        self._handed_over = False
        self._succession: Succession | None = None
        self._file: StateFile | None = None
        self._depth = DepthInput(context)
        if live:
            # In a lossless run the stream is the clock; what comes beside it has no place in it.
            self._succession = Succession(
                context.session, self._out, keys.tracks(camera),
                ("tracker", camera, context.producer), resources, context.log,
            )  # fmt: skip
            name = f"tracker-{context.robot}-{camera}-{context.settings.instance}"
            self._file = StateFile(name, resources, context.log)

    def run(self) -> None:
        """Track, or stand by, until the stream ends or the service is stopped."""
        context, succession = self._context, self._succession
        stands_by = context.settings.standby and succession is not None
        line = handed_over = None
        if not stands_by:
            line = self._left_behind()
        context.announce()
        if succession is None:
            self._track()
            return
        while context.running:
            if stands_by:
                with ExitStack() as standing_by:
                    line = self._stand_by(standing_by, handed_over)
                if not context.running:
                    return
            succession.lead(line, state=True, yields=context.settings.standby and line is None)
            self._events_out.line, self._events_out.turn = self._out.line, self._out.turn
            for received, tracks in self._unanswered:
                self._send(received, tracks, time.monotonic())
            if self._track():
                return
            handed_over = succession.line if self._handed_over else None
            succession.step_back()
            stands_by = True

    def _left_behind(self) -> Line | None:
        """Take up what a tracker has left that ended a moment ago; the line that this goes on with.

        Time has passed since, so that everybody has to be re-identified.
        """
        self._unanswered: list[tuple[Received[Blobs], Tracks]] = []
        left = None if self._file is None else self._file.load()
        context = self._context
        key = keys.snapshot(context.settings.camera, "tracker")
        if left is None or leads_already(context.session, key):
            return None
        try:
            self._tracker.restore(left.state)
        except HeelError as error:
            context.log.warning("%s", error)
            return None
        self._tracker.interrupt()
        self._on_trial = _TRIAL_FRAMES
        context.log.info("going on with the people of %s, as far as they are known again",
                         left.producer)  # fmt: skip
        return Line(left.line, left.turn + 1)

    def _stand_by(self, resources: ExitStack, handed_over: Line | None) -> Line | None:
        """Follow the tracker that sends until it is time to take over; the line to go on with.

        Args:
            resources: end what is declared.
            handed_over: the line that this process has handed over a moment ago, if it has.
        """
        context, camera = self._context, self._context.settings.camera
        if self._others is None:
            self._others = context.subscribe("tracks", keys.tracks(camera), qos.TRACKS, False)
        question = SnapshotQuestion(context.session, keys.snapshot(camera, "tracker"))
        shadow = Shadow(self._tracker)
        standing = StandingBy(context.session, context.producer, resources)
        if handed_over is not None and self._newest is not None:
            # Should the successor never be heard, this one goes on where it was.
            shadow.resume(self._newest)
            standing.line = Line(handed_over.began, handed_over.turn + 2)
        self._trace.pause(True)
        while context.running and not standing.is_due(shadow.oldest_unanswered_s, shadow.in_step):
            with context.surviving("standing by"):
                for arrival in context.inbox.all_of(_TURN_S):
                    if arrival.encoding != EndOfStream.encoding():
                        self._hear(arrival, standing, shadow)
                self._catch_up(shadow, question)
            why_not = question.refusal or "its state is asked for"
            context.statistics.detail(STANDBY, standing.told(shadow.in_step, why_not))
        self._trace.pause(False)
        context.statistics.detail(STANDBY, None)
        if not context.running:
            return None
        line = standing.line if shadow.in_step else None
        ids = "with the same ids" if line else "with ids of its own, being out of step"
        context.log.warning("%s: taking over %s", standing.why, ids)
        self._unanswered = []
        with context.surviving("taking over"):
            self._unanswered = list(shadow.take_over())[-_MOST_UNANSWERED:]
        return line

    def _hear(self, arrival: Arrival, standing: StandingBy, shadow: Shadow) -> None:
        assert self._others is not None
        if arrival.topic == "blobs":
            blobs = self._blobs.message(arrival, Blobs)
            if blobs is not None:
                self._context.statistics.input(arrival.arrived_s)
                shadow.hear_blobs(blobs)
        else:
            tracks = self._others.message(arrival, Tracks)
            if tracks is not None:
                standing.hear(tracks.stamp, tracks.arrived_s)
                shadow.hear_tracks(tracks.message)

    def _catch_up(self, shadow: Shadow, question: SnapshotQuestion) -> None:
        if not shadow.wants_state:
            return
        try:
            state = question.poll(time.monotonic())
            if state is not None:
                shadow.restore(state.state, state.frame)
        except HeelError as error:
            question.refusal = str(error)
            self._context.warn.warning("state", str(error), time.monotonic())

    def _track(self) -> bool:
        """Track until the service is to end (True), or another one sends from now on."""
        context, succession = self._context, self._succession
        self._handed_over = False
        goes_on = None if succession is None else self._turn
        for arrival in context.arrivals(self._blobs, self._out, goes_on):
            received = self._blobs.message(arrival, Blobs)
            if received is None:
                continue
            context.statistics.input(arrival.arrived_s)
            started_s, failed = time.monotonic(), context.statistics.failed
            self._events.begin(received.message.frame_id(), started_s)
            with context.surviving("tracking"):
                try:
                    tracks = self._tracker.update(received.message)
                    tracks = self._placed(tracks, started_s)
                except (MessageError, SettingsError) as error:
                    self._blobs.refuse(arrival, error)
                    continue
                if not self._may_send():
                    return False
                successor = None if succession is None else succession.successor()
                self._send(received, tracks, started_s, successor)
                self._tracker.settle()
                self._keep_state()
                if successor is not None:
                    self._handed_over = True
                    return False
            self._try_out(context.statistics.failed > failed)
        return not context.running or self._may_send()

    def _placed(self, tracks: Tracks, now_s: float) -> Tracks:
        """With distances by depth, where there is any; who they are does not hang on it."""
        with self._context.surviving("measuring by depth"):
            return self._depth.placed(tracks, now_s)
        return tracks

    def _send(
        self, received: Received[Blobs], tracks: Tracks, started_s: float,
        successor: str | None = None,
    ) -> None:  # fmt: skip
        now_s = time.monotonic()
        age_s = received.age_s(now_s)
        self._out.send(tracks, age_s, successor)
        self._newest = tracks.frame_id()
        self._context.statistics.output(now_s, now_s - started_s, age_s)
        self._context.statistics.detail(WITHHELD, self._tracker.withheld or None)

    def _may_send(self) -> bool:
        return self._succession is None or self._succession.may_send(self._context.stop.wait)

    def _turn(self) -> bool:
        """Between two frames; whether this is still the tracker that sends."""
        assert self._succession is not None
        self._succession.answer(self._snapshot)
        return self._may_send()

    def _snapshot(self) -> Snapshot | None:
        if self._newest is None or self._succession is None:
            return None
        state = self._tracker.snapshot()
        if state is None:
            raise HeelError("the tracker has no state to give: preset paper is run as printed")
        return Snapshot(
            service="tracker", producer=self._context.producer,
            line=self._succession.line.began, turn=self._succession.line.turn,
            frame=self._newest, state=state,
        )  # fmt: skip

    def _keep_state(self) -> None:
        if self._file is None or self._context.settings.preset == "paper":
            return
        now_s = time.monotonic()
        if self._file.is_due(now_s) and (state := self._snapshot()) is not None:
            self._file.write(state, now_s)

    def _try_out(self, failed: bool) -> None:
        """Begin anew where a state that came from elsewhere makes the tracker fail."""
        if not self._on_trial:
            return
        self._on_trial -= 1
        if failed:
            self._on_trial = 0
            self._context.log.warning("the state that was left cannot be worked with: new people")
            self._tracker = configured(self._context.settings, self._trace)
            self._out.line = self._events_out.line = None


def run(loaded: Loaded[TrackerServiceSettings]) -> int:
    """Run the tracker process; returns its exit code."""
    # Four processes share the cores already: threads inside OpenCV only take turns.
    cv2.setNumThreads(1)
    return run_service("tracker", loaded, serve)
