"""The tracker as a process: blobs in, tracks out."""

from __future__ import annotations

import logging
import time
from contextlib import ExitStack

import cv2

from heel.schemas import Blobs, MessageError, keys
from heel.schemas.errors import SettingsError
from heel.services.runtime import qos
from heel.services.runtime.service import ServiceContext, run_service
from heel.services.runtime.settings import Loaded
from heel.services.tracker.core import configured, warm_up
from heel.services.tracker.settings import TrackerServiceSettings
from heel.services.tracker.story import sentence
from heel.services.tracker.trace import Event, Trace
from heel.services.tracker.trace_file import TraceFile

_log = logging.getLogger("heel.tracker")


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
    tracker = configured(context.settings, trace)
    camera = context.settings.camera
    judge = context.subscribe("blobs", keys.blobs(camera), qos.BLOBS)
    out = context.publisher(keys.tracks(camera), qos.TRACKS)
    context.announce()
    for arrival in context.arrivals(judge, out):
        received = judge.message(arrival, Blobs)
        if received is None:
            continue
        context.statistics.input(arrival.arrived_s)
        started_s = time.monotonic()
        with context.surviving("tracking"):
            try:
                tracks = tracker.update(received.message)
            except (MessageError, SettingsError) as error:
                judge.refuse(arrival, error)
                continue
            now_s = time.monotonic()
            out.send(tracks, received.age_s(now_s))
            context.statistics.output(now_s, now_s - started_s, received.age_s(now_s))
            tracker.settle()


def run(loaded: Loaded[TrackerServiceSettings]) -> int:
    """Run the tracker process; returns its exit code."""
    # Four processes share the cores already: threads inside OpenCV only take turns.
    cv2.setNumThreads(1)
    return run_service("tracker", loaded, serve)
