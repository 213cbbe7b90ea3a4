"""The tracker as a process: blobs in, tracks out."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import ExitStack

import cv2

from heel.schemas import Blobs, FrameId, MessageError, TrackEvent, keys
from heel.schemas.errors import SettingsError
from heel.services.runtime import qos
from heel.services.runtime.chain import WITHHELD
from heel.services.runtime.publishing import StreamPublisher
from heel.services.runtime.service import ServiceContext, run_service
from heel.services.runtime.settings import Loaded
from heel.services.tracker.core import configured, warm_up
from heel.services.tracker.settings import TrackerServiceSettings
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
    with ExitStack() as stack:
        trace = Trace(log_identities)
        if context.settings.trace is not None:
            trace.add(stack.enter_context(TraceFile(context.settings.trace)).take)
        _track(context, trace)


def _track(context: ServiceContext[TrackerServiceSettings], trace: Trace) -> None:
    warm_up()
    camera = context.settings.camera
    # Nothing waits for them, not even in a lossless run.
    sender = StreamPublisher(
        context.session, keys.events(camera), qos.EVENTS, "live", context.producer
    )  # fmt: skip
    events = Events(lambda event: sender.send(event, 0.0))
    trace.add(events.take)
    tracker = configured(context.settings, trace)
    judge = context.subscribe("blobs", keys.blobs(camera), qos.BLOBS)
    out = context.publisher(keys.tracks(camera), qos.TRACKS)
    context.announce()
    for arrival in context.arrivals(judge, out):
        received = judge.message(arrival, Blobs)
        if received is None:
            continue
        context.statistics.input(arrival.arrived_s)
        started_s = time.monotonic()
        events.begin(received.message.frame_id(), started_s)
        with context.surviving("tracking"):
            try:
                tracks = tracker.update(received.message)
            except (MessageError, SettingsError) as error:
                judge.refuse(arrival, error)
                continue
            now_s = time.monotonic()
            out.send(tracks, received.age_s(now_s))
            context.statistics.output(now_s, now_s - started_s, received.age_s(now_s))
            context.statistics.detail(WITHHELD, tracker.withheld or None)
            tracker.settle()


def run(loaded: Loaded[TrackerServiceSettings]) -> int:
    """Run the tracker process; returns its exit code."""
    # Four processes share the cores already: threads inside OpenCV only take turns.
    cv2.setNumThreads(1)
    return run_service("tracker", loaded, serve)
