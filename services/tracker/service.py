"""The tracker as a process: blobs in, tracks out."""

from __future__ import annotations

import time

import cv2

from heel.schemas import Blobs, MessageError, keys
from heel.schemas.errors import SettingsError
from heel.services.runtime import qos
from heel.services.runtime.service import ServiceContext, run_service
from heel.services.runtime.settings import Loaded
from heel.services.tracker.core import configured, warm_up
from heel.services.tracker.settings import TrackerServiceSettings


def serve(context: ServiceContext[TrackerServiceSettings]) -> None:
    """Track until the stream ends or the service is stopped."""
    warm_up()
    tracker = configured(context.settings)
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
