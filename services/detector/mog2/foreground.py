"""Foreground by MOG2: shadow removal, morphology, components, the paper's true-blob test."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import FrameId, Tracks
from heel.services.detector.geometry import WorkSize
from heel.services.detector.mog2.background import BackgroundModel
from heel.services.detector.mog2.numbers import COMPOSITE, PAPER
from heel.services.detector.mog2.protection import Protection
from heel.services.detector.mog2.true_blobs import find_regions
from heel.services.detector.motion import FrameDifference, mark_moving
from heel.services.detector.regions import Seen, smoothed
from heel.services.detector.settings import DetectorSettings


class Mog2Foreground:
    """MOG2 of one scene. Each frame is learned at once, with tracks moved ahead to it."""

    name = "mog2"

    def __init__(self, size: WorkSize, settings: DetectorSettings) -> None:
        numbers = PAPER if settings.preset == "paper" else COMPOSITE
        self._size = size
        self._numbers = numbers
        self._blur_px = settings.blur_px
        self._model = BackgroundModel(
            numbers.history_frames, numbers.variance_threshold, settings.shadow_ratio
        )
        self._protection = Protection(size, numbers.protect_margin, numbers.protect_still_s)
        self._motion = FrameDifference()
        self._frames = 0

    def look(self, image: NDArray[np.uint8], frame: FrameId, feedback: Tracks | None) -> Seen:
        """See and learn one frame."""
        numbers = self._numbers
        self._frames += 1
        learning = self._frames <= numbers.learning_frames
        protected = None
        if feedback is not None and not learning:
            protected = self._protection.mask(feedback, frame.t_capture_ns)
        smooth = smoothed(image, self._blur_px)
        evidence = self._model.classify(smooth, protected)
        if numbers.median_px:
            evidence = np.asarray(cv2.medianBlur(evidence, numbers.median_px), np.uint8)
        regions = find_regions(evidence, self._size, numbers)
        if numbers.tells_motion:
            evidence = mark_moving(evidence, self._motion.update(smooth, frame.t_capture_ns))
        protected_seq = None if protected is None or feedback is None else feedback.seq
        return Seen(evidence, regions, learning, protected_seq)
