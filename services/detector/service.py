"""The detector as a process: images in, blobs out, tracks back in as protection."""

from __future__ import annotations

import time
from collections import deque
from contextlib import ExitStack
from dataclasses import dataclass

import cv2

from heel.schemas import (
    Blobs,
    EndOfStream,
    FrameId,
    Header,
    HeelError,
    MessageError,
    Pointed,
    Snapshot,
    Tracks,
    decode,
    keys,
)
from heel.schemas.image import decode_image
from heel.services.detector.core import Detector
from heel.services.detector.feedback import FeedbackBuffer
from heel.services.detector.settings import DetectorServiceSettings
from heel.services.runtime import qos
from heel.services.runtime.chain import STANDBY
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.service import ServiceContext, run_service
from heel.services.runtime.settings import Loaded
from heel.services.runtime.state_file import StateFile
from heel.services.runtime.streams import StreamJudge
from heel.services.runtime.succession import Line, StandingBy, Succession

_FEEDBACK_TIMEOUT_S = 2.0
"""Longest wait of a lossless run for the tracks of an earlier frame: a tracker takes milliseconds,
one that has ended never answers."""
_POLL_S = 0.2  # longest wait at once, so that a stop is noticed
_TURN_S = 0.05
"""Longest wait [s] of a detector that stands by before it looks whether to take over."""
_MOST_UNANSWERED = 2
"""Frames answered at the moment of taking over: older ones are of no use to anybody, as many wait
at any receiver."""


@dataclass(frozen=True)
class _Found:
    """What is on a frame.

    Attributes:
        blobs: the answer.
        sent_age_s: of the frame when it was sent.
        arrived_s: monotonic time at which it came.
    """

    blobs: Blobs
    sent_age_s: float
    arrived_s: float


class Unanswered:
    """What one that stands by has found and nobody has answered: the newest, and since when."""

    def __init__(self) -> None:
        self.newest: deque[_Found] = deque(maxlen=_MOST_UNANSWERED)
        self.since_s: float | None = None
        """When the oldest of them came, those that are not kept any more included."""

    def clear(self) -> None:
        """Begin anew."""
        self.newest.clear()
        self.since_s = None

    def add(self, found: _Found) -> None:
        """A frame whose answer has not been heard."""
        if self.since_s is None:
            self.since_s = found.arrived_s
        self.newest.append(found)

    def answered(self, told: Blobs) -> None:
        """That answer was heard: of its frame and of all before."""
        while self.newest:
            own = self.newest[0]
            if own.blobs.epoch == told.epoch and own.blobs.seq > told.seq:
                self.since_s = own.arrived_s
                return
            self.newest.popleft()
        self.since_s = None


class DetectorService:
    """Wires the detector core to its topics."""

    def __init__(
        self, context: ServiceContext[DetectorServiceSettings], resources: ExitStack
    ) -> None:
        self._context = context
        self._unanswered = Unanswered()
        self._settings = context.settings
        if context.settings.hint is not None:
            context.log.info("%s", context.settings.hint)
        self._live = live = context.settings.delivery == "live"
        self._detector = Detector(context.settings, time.monotonic if live else None)
        self._feedback = FeedbackBuffer(context.settings.feedback_lag_frames)
        camera = context.settings.camera
        self._images = context.subscribe_images(qos.IMAGE)
        self._tracks = context.subscribe("tracks", keys.tracks(camera), qos.TRACKS, primary=False)
        if live:
            # In a lossless run what is found depends on the pictures alone.
            context.inbox.subscribe("pointed", keys.FOLLOW_POINTED, qos.POINTED)
        self._out = context.publisher(keys.blobs(camera), qos.BLOBS)
        self._others: StreamJudge | None = None
        self._succession: Succession | None = None
        self._file: StateFile | None = None
        self._resumed = False
        if live:
            name = f"detector-{context.robot}-{camera}-{context.settings.instance}"
            self._file = StateFile(name, resources, context.log)
            self._succession = Succession(
                context.session, self._out, keys.blobs(camera),
                ("detector", camera, context.producer), resources, context.log,
            )  # fmt: skip

    def run(self) -> None:
        """Detect, or stand by, until the stream ends or the service is stopped."""
        context, succession = self._context, self._succession
        context.announce()
        if succession is None:
            self._lead()
            return
        stands_by, line = context.settings.standby, None
        if not stands_by:
            self._take_up()
        while context.running:
            if stands_by:
                with ExitStack() as standing_by:
                    line = self._stand_by(standing_by)
                if not context.running:
                    return
            succession.lead(line, state=False, yields=context.settings.standby and line is None)
            for found in self._unanswered.newest:
                self._send(found, time.monotonic())
            self._unanswered.clear()
            if self._lead():
                return
            succession.step_back()
            stands_by = True

    def _lead(self) -> bool:
        """Detect until the service is to end (True), or another one sends from now on."""
        context, succession = self._context, self._succession
        goes_on = None if succession is None else self._may_send
        for arrival in context.arrivals(self._images, self._out, goes_on):
            failed = context.statistics.failed
            with context.surviving("detecting"):
                started_s = time.monotonic()
                found = self._found(arrival)
                if found is None:
                    continue
                if not self._may_send():
                    return False
                successor = None if succession is None else succession.successor()
                self._send(found, started_s, successor)
                self._keep_state(found.blobs)
                if successor is not None:
                    return False
            if self._resumed and context.statistics.failed > failed:
                self._resumed = False
                context.log.warning("the state that was left cannot be worked with: beginning anew")
                self._detector = Detector(self._settings, time.monotonic)
        return not context.running or self._may_send()

    def _take_up(self) -> None:
        """Go on from what a detector has left that ended a moment ago."""
        left = None if self._file is None else self._file.load()
        if left is None:
            return
        try:
            self._detector.restore(left.state)
        except HeelError as error:
            self._context.log.warning("%s", error)
            return
        self._resumed = True
        self._context.log.info("going on with what %s has left", left.producer)

    def _keep_state(self, newest: Blobs) -> None:
        now_s = time.monotonic()
        if self._file is None or self._succession is None or not self._file.is_due(now_s):
            return
        if (state := self._detector.snapshot()) is not None:
            line = self._succession.line
            self._file.write(
                Snapshot(service="detector", producer=self._context.producer, line=line.began,
                         turn=line.turn, frame=newest.frame_id(), state=state), now_s,
            )  # fmt: skip

    def _stand_by(self, resources: ExitStack) -> Line | None:
        """Learn the same pictures until it is time to take over; the line to go on with."""
        context, camera = self._context, self._context.settings.camera
        if self._others is None:
            self._others = context.subscribe("blobs", keys.blobs(camera), qos.BLOBS, False)
        standing = StandingBy(context.session, context.producer, resources)
        self._unanswered.clear()
        ready = False
        while context.running and not standing.is_due(self._unanswered.since_s, ready):
            with context.surviving("standing by"):
                for arrival in context.inbox.all_of(_TURN_S, "image", "blobs"):
                    if arrival.encoding == EndOfStream.encoding():
                        continue
                    if arrival.topic == "blobs":
                        other = self._others.message(arrival, Blobs)
                        if other is not None:
                            standing.hear(other.stamp, other.arrived_s)
                            self._unanswered.answered(other.message)
                    elif (found := self._found(arrival)) is not None:
                        ready = found.blobs.background == "valid" or found.blobs.kind == "people"
                        self._unanswered.add(found)
            context.statistics.detail(STANDBY, standing.told(ready, "it learns the background"))
        context.statistics.detail(STANDBY, None)
        if context.running:
            context.log.warning("%s: taking over", standing.why)
        return standing.line

    def _may_send(self) -> bool:
        return self._succession is None or self._succession.may_send(self._context.stop.wait)

    def _found(self, arrival: Arrival) -> _Found | None:
        header = self._images.header(arrival)
        blobs = None if header is None else self._detect(arrival, header)
        if header is None or blobs is None:
            return None
        return _Found(blobs, header.age_ns * 1e-9, arrival.arrived_s)

    def _send(self, found: _Found, started_s: float, successor: str | None = None) -> None:
        now_s = time.monotonic()
        age_s = found.sent_age_s + now_s - found.arrived_s
        self._out.send(found.blobs, age_s, successor)
        self._context.statistics.output(now_s, now_s - started_s, age_s)

    def _detect(self, arrival: Arrival, header: Header) -> Blobs | None:
        statistics = self._context.statistics
        try:
            image = decode_image(arrival.payload, header, arrival.encoding)
        except MessageError as error:
            self._images.refuse(arrival, error)
            return None
        statistics.input(arrival.arrived_s)
        frame = header.frame_id()
        source = (header.source_width, header.source_height)
        protection, pointed = self._protection(frame), self._pointed()
        blobs = self._detector.detect(frame, image, source, protection, pointed)
        statistics.details["background"] = f"{blobs.background} {blobs.background_reason}".strip()
        return blobs

    def _protection(self, frame: FrameId) -> Tracks | None:
        """Tracks from `feedback_lag_frames` ago; a lossless run waits for exactly those."""
        while (arrival := self._context.inbox.get(0, "tracks")) is not None:
            self._take(arrival, self._tracks)
        if self._settings.delivery == "live":
            return self._feedback.newest(frame)
        if frame.seq < self._settings.feedback_lag_frames:
            return None
        # Without a tracker only the first frame that could have had tracks waits for them.
        alone = self._tracks.gate.current is None
        if alone and frame.seq > self._settings.feedback_lag_frames:
            return None
        return self._await(frame)

    def _pointed(self) -> Pointed | None:
        """Where a user has pointed since the last frame, if anywhere."""
        pointed = None
        while self._live and (arrival := self._context.inbox.get(0, "pointed")) is not None:
            try:
                pointed = decode(Pointed, arrival.payload, arrival.encoding)
            except MessageError as error:
                self._context.statistics.malformed += 1
                self._context.warn.warning(
                    arrival.topic, f"{arrival.key}: {error}", arrival.arrived_s
                )
        return pointed

    def _await(self, frame: FrameId) -> Tracks | None:
        deadline_s = time.monotonic() + _FEEDBACK_TIMEOUT_S
        while self._context.running:
            tracks = self._feedback.exact(frame)
            if tracks is not None:
                self._context.statistics.problem("feedback", None)
                return tracks
            remaining_s = deadline_s - time.monotonic()
            if remaining_s <= 0:
                break
            arrival = self._context.inbox.get(min(remaining_s, _POLL_S), "tracks")
            if arrival is not None:
                self._take(arrival, self._tracks)
        reason = (
            f"no tracks of frame {frame.seq - self._settings.feedback_lag_frames} within "
            f"{_FEEDBACK_TIMEOUT_S:g} s: going on without protecting people; "
            "this run is not repeatable"
        )
        if self._context.statistics.problem("feedback", reason):
            self._context.log.warning("%s", reason)
        return None

    def _take(self, arrival: Arrival, judge: StreamJudge) -> None:
        if arrival.encoding == EndOfStream.encoding():
            # It says nothing about the images, but a malformed one is counted like any other.
            judge.end(arrival)
            return
        received = judge.message(arrival, Tracks)
        if received is not None:
            self._feedback.add(received.message)


def serve(context: ServiceContext[DetectorServiceSettings]) -> None:
    """Detect until the stream ends or the service is stopped."""
    with ExitStack() as resources:
        DetectorService(context, resources).run()


def run(loaded: Loaded[DetectorServiceSettings]) -> int:
    """Run the detector process; returns its exit code."""
    # Four processes share the cores already: threads inside OpenCV only take turns.
    cv2.setNumThreads(1)
    return run_service("detector", loaded, serve)
