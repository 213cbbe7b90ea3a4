"""Foreground by the mixture: classify, correct what is not known yet, learn late, find ghosts."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import FrameId, Tracks
from heel.schemas.blobs import FOREGROUND
from heel.services.detector.geometry import WorkSize
from heel.services.detector.mixture.ghosts import GhostFinder
from heel.services.detector.mixture.late import LateFrames
from heel.services.detector.mixture.model import BackgroundMixture
from heel.services.detector.mixture.startup import StillnessGate
from heel.services.detector.motion import FrameDifference, mark_moving
from heel.services.detector.regions import Indices, Learned, Region, Seen, regions_of, smoothed
from heel.services.detector.settings import DetectorSettings

_GHOST_FRAMES = 3
_MEDIAN_PX = 5
_CLOSE = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 7))


class MixtureForeground:
    """The mixture of one scene and all that keeps it clean of people."""

    name = "mixture"

    def __init__(
        self, size: WorkSize, settings: DetectorSettings, learned: Learned | None = None
    ) -> None:
        """Start with nothing known, or with what another model has learned."""
        self._learned = learned
        self._size = size
        self._settings = settings
        self._motion = FrameDifference()
        self._frames = 0

    def look(self, image: NDArray[np.uint8], frame: FrameId, feedback: Tracks | None) -> Seen:
        """See one frame; learn those whose tracks are here."""
        smooth = smoothed(image, self._settings.blur_px)
        self._frames += 1
        first = self._frames == 1
        if first:
            self._start(smooth, frame.t_capture_ns)
        protected_seq = self._learn(feedback)
        evidence = self._evidence(smooth, frame.t_capture_ns)
        if not first:
            self._late.add(frame, smooth)
        regions = find_regions(evidence, self._settings.min_blob_area_px)
        return Seen(evidence, regions, self._gate.learning, protected_seq)

    def _start(self, smooth: NDArray[np.uint8], t_ns: int) -> None:
        settings, shape = self._settings, (self._size.height, self._size.width)
        self._model = BackgroundMixture(
            smooth,
            settings.foreground_sigmas,
            settings.learning_rate_per_s,
            settings.shadow_ratio,
        )
        known = None
        if self._learned is not None:
            self._model.resume(self._learned)
            known, self._learned = self._learned.known, None
        self._gate = StillnessGate(shape, t_ns, settings.startup_s, known)
        self._ghosts = GhostFinder(shape, t_ns)
        self._late = LateFrames(self._size, settings.feedback_lag_frames, t_ns)

    @property
    def learned(self) -> Learned:
        """What is known by now; only after the first frame."""
        return Learned(self._model.mean, self._model.variance, self._gate.known)

    def _learn(self, feedback: Tracks | None) -> int | None:
        protected_seq = None
        for late in self._late.due(feedback):
            self._model.learn(late.image, self._gate.allow(late.free), late.dt_s)
            protected_seq = late.protected_seq
        return protected_seq

    def _evidence(self, smooth: NDArray[np.uint8], t_ns: int) -> NDArray[np.uint8]:
        evidence = self._model.classify(smooth)
        moving = self._motion.update(smooth, t_ns)
        self._restart(smooth, self._gate.settle(moving, t_ns))
        evidence = self._gate.correct(evidence, moving)
        evidence = mark_moving(np.asarray(cv2.medianBlur(evidence, _MEDIAN_PX), np.uint8), moving)
        if self._settings.dissolve_ghosts and self._frames % _GHOST_FRAMES == 0:
            ghosts = self._ghosts.find(smooth, self._model.mean, foreground(evidence), t_ns)
            self._restart(smooth, ghosts)
        return evidence

    def _restart(self, smooth: NDArray[np.uint8], index: Indices) -> None:
        self._model.restart(smooth, index)
        self._late.forget(index)


def find_regions(evidence: NDArray[np.uint8], min_area_px: int) -> list[Region]:
    """Connected foreground, largest first.

    Small ones stay: a person cut up by a lamp post is put together by the tracker.
    """
    closed = cv2.morphologyEx(foreground(evidence), cv2.MORPH_CLOSE, _CLOSE)
    regions = regions_of(np.asarray(closed, np.uint8))
    return [region for region in regions if region.area >= min_area_px]


def foreground(evidence: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """255 where FOREGROUND or MOVING, else 0."""
    return np.asarray(cv2.threshold(evidence, FOREGROUND - 1, 255, cv2.THRESH_BINARY)[1], np.uint8)
