"""Foreground from a camera that moves: estimate its motion, carry the background, compare."""

from __future__ import annotations

from collections import OrderedDict

import cv2
import numpy as np
from numpy.typing import NDArray

from schemas import FrameId, Tracks
from services.detector.camera_motion import Affine, EgoMotion, MotionEstimate, compose
from services.detector.ego.background import CarriedBackground
from services.detector.free_mask import free_mask
from services.detector.geometry import WorkSize
from services.detector.mixture.foreground import find_regions
from services.detector.motion import FrameDifference, mark_moving
from services.detector.regions import Seen, smoothed
from services.detector.settings import DetectorSettings

_MEDIAN_PX = 5
_LEARNING_FRAMES = 4
_KEPT_FRAMES = 64


class CameraPath:
    """Where the camera has looked of late: the motion between any two recent frames."""

    def __init__(self) -> None:
        self._total: Affine = np.eye(2, 3)
        self._by_seq: OrderedDict[int, Affine] = OrderedDict()

    def add(self, seq: int, motion: Affine) -> None:
        """The camera moved by `motion` to get to frame `seq`."""
        self._total = compose(motion, self._total)
        self._by_seq[seq] = self._total
        while len(self._by_seq) > _KEPT_FRAMES:
            self._by_seq.popitem(last=False)

    def since(self, seq: int) -> Affine | None:
        """Motion from frame `seq` to the newest; None if that is too long ago."""
        then = self._by_seq.get(seq)
        if then is None:
            return None
        return compose(self._total, np.asarray(cv2.invertAffineTransform(then), np.float64))


class EgoForeground:
    """The carried background of one scene."""

    name = "ego"

    def __init__(self, size: WorkSize, settings: DetectorSettings) -> None:
        self._size = size
        self._settings = settings
        self._ego = EgoMotion()
        self._path = CameraPath()
        self._difference = FrameDifference()
        self._model: CarriedBackground | None = None
        self._frames = 0
        self._free = np.full((size.height, size.width), 255, np.uint8)

    def look(self, image: NDArray[np.uint8], frame: FrameId, feedback: Tracks | None) -> Seen:
        """See and learn one frame."""
        smooth = smoothed(image, self._settings.blur_px)
        self._frames += 1
        grey = np.asarray(cv2.cvtColor(smooth, cv2.COLOR_BGR2GRAY), np.uint8)
        motion = self._ego.update(grey, self._free)
        model = self._moved(motion, smooth)
        self._path.add(frame.seq, motion.affine)
        moving = self._difference.update(smooth, frame.t_capture_ns, motion.affine)
        evidence = model.classify(smooth, moving)
        evidence = np.asarray(cv2.medianBlur(evidence, _MEDIAN_PX), np.uint8)
        self._free, protected_seq = self._protect(frame, feedback)
        model.learn(smooth, self._free)
        regions = find_regions(evidence, self._settings.min_blob_area_px)
        evidence = mark_moving(evidence, moving)
        learning = self._frames <= _LEARNING_FRAMES
        return Seen(evidence, regions, learning, protected_seq, motion)

    def _moved(self, motion: MotionEstimate, smooth: NDArray[np.uint8]) -> CarriedBackground:
        """The model in this frame's pixels; a new one where the camera's motion is unknown."""
        if self._model is None or not motion.is_known:
            self._model = CarriedBackground(
                smooth, self._settings.carried_sigmas, self._settings.shadow_ratio
            )
            self._frames = 1
        else:
            self._model.move(motion.affine, smooth)
        return self._model

    def _protect(
        self, frame: FrameId, feedback: Tracks | None
    ) -> tuple[NDArray[np.uint8], int | None]:
        camera = None if feedback is None else self._path.since(feedback.seq)
        if feedback is None or camera is None:
            return free_mask(None, frame, self._size), None
        return free_mask(feedback, frame, self._size, camera), feedback.seq
