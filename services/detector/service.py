"""The detector as a process: images in, blobs out, tracks back in as protection."""

from __future__ import annotations

import time

import cv2

from heel.schemas import (
    Blobs,
    EndOfStream,
    FrameId,
    Header,
    MessageError,
    Pointed,
    Tracks,
    decode,
    keys,
)
from heel.schemas.image import decode_image
from heel.services.detector.core import Detector
from heel.services.detector.feedback import FeedbackBuffer
from heel.services.detector.settings import DetectorServiceSettings
from heel.services.runtime import qos
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.service import ServiceContext, run_service
from heel.services.runtime.settings import Loaded
from heel.services.runtime.streams import StreamJudge

_FEEDBACK_TIMEOUT_S = 2.0
"""Longest wait of a lossless run for the tracks of an earlier frame: a tracker takes milliseconds,
one that has ended never answers."""
_POLL_S = 0.2  # longest wait at once, so that a stop is noticed


class DetectorService:
    """Wires the detector core to its topics."""

    def __init__(self, context: ServiceContext[DetectorServiceSettings]) -> None:
        self._context = context
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

    def run(self) -> None:
        """Detect until the stream ends or the service is stopped."""
        self._context.announce()
        for arrival in self._context.arrivals(self._images, self._out):
            header = self._images.header(arrival)
            if header is None:
                continue
            with self._context.surviving("detecting"):
                self._answer(arrival, header)

    def _answer(self, arrival: Arrival, header: Header) -> None:
        started_s = time.monotonic()
        blobs = self._detect(arrival, header)
        if blobs is None:
            return
        now_s = time.monotonic()
        age_s = header.age_ns * 1e-9 + now_s - arrival.arrived_s
        self._out.send(blobs, age_s)
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


def run(loaded: Loaded[DetectorServiceSettings]) -> int:
    """Run the detector process; returns its exit code."""
    # Four processes share the cores already: threads inside OpenCV only take turns.
    cv2.setNumThreads(1)
    return run_service("detector", loaded, lambda context: DetectorService(context).run())
