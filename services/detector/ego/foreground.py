"""Foreground from a camera that moves: estimate its motion, carry the background, compare."""

from __future__ import annotations

from collections import OrderedDict

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import FrameId, Tracks
from heel.services.detector.camera_motion import Affine, EgoMotion, MotionEstimate, compose
from heel.services.detector.ego.background import CarriedBackground
from heel.services.detector.free_mask import free_mask
from heel.services.detector.geometry import WorkSize
from heel.services.detector.mixture.foreground import find_regions, foreground
from heel.services.detector.mixture.ghosts import GhostFinder
from heel.services.detector.motion import FrameDifference, mark_moving
from heel.services.detector.regions import Learned, Seen, smoothed
from heel.services.detector.settings import DetectorSettings

_MEDIAN_PX = 5
_GHOST_FRAMES = 3
_LEARNING_FRAMES = 4
_KEPT_FRAMES = 64
_LOST_FRAMES = 5
"""Frames without known motion after which the model starts over."""


class CameraPath:
    """Where the camera has looked of late: the motion between any two recent frames."""

    def __init__(self) -> None:
        self._total: Affine = np.eye(2, 3)
        self._by_seq: OrderedDict[int, Affine] = OrderedDict()
        self._first_seq: int | None = None

    def add(self, seq: int, motion: Affine) -> None:
        """The camera moved by `motion` to get to frame `seq`."""
        if self._first_seq is None:
            self._first_seq = seq
        self._total = compose(motion, self._total)
        self._by_seq[seq] = self._total
        while len(self._by_seq) > _KEPT_FRAMES:
            self._by_seq.popitem(last=False)

    def since(self, seq: int) -> Affine | None:
        """Motion from frame `seq` to the newest; None if that is too long ago.

        Before the first frame the camera stood still.
        """
        if self._first_seq is not None and seq < self._first_seq:
            return self._total
        then = self._by_seq.get(seq)
        if then is None:
            return None
        back = np.asarray(cv2.invertAffineTransform(then), np.float64)
        return compose(self._total, back)


class EgoForeground:
    """The carried background of one scene."""

    name = "ego"

    def __init__(
        self, size: WorkSize, settings: DetectorSettings, learned: Learned | None = None
    ) -> None:
        """Start with nothing known, or with what another model has learned."""
        self._size = size
        self._settings = settings
        self._resumed = learned
        self._ego = EgoMotion()
        self._path = CameraPath()
        self._difference = FrameDifference()
        self._ghosts: GhostFinder | None = None
        self._model: CarriedBackground | None = None
        self._frames = 0
        self._lost_frames = 0
        self._free = np.full((size.height, size.width), 255, np.uint8)

    @property
    def learned(self) -> Learned:
        """What is known by now; only after the first frame."""
        assert self._model is not None
        return self._model.learned

    def look(
        self,
        image: NDArray[np.uint8],
        frame: FrameId,
        feedback: Tracks | None,
        first_motion: MotionEstimate | None = None,
    ) -> Seen:
        """See and learn one frame.

        Args:
            image: (H, W, 3) uint8 BGR at working size.
            frame: which frame this is.
            feedback: tracks of an earlier frame of this scene.
            first_motion: in the first frame, the motion since what was learned before.
        """
        smooth = smoothed(image, self._settings.blur_px)
        self._frames += 1
        grey = np.asarray(cv2.cvtColor(smooth, cv2.COLOR_BGR2GRAY), np.uint8)
        motion = self._ego.update(grey, self._free)
        motion = motion if first_motion is None else first_motion
        model = self._carried(motion, smooth)
        if model is None:
            return Seen(None, [], False, None, motion, "the camera's motion cannot be told")
        self._path.add(frame.seq, motion.affine)
        if self._ghosts is not None:
            self._ghosts.move(motion.affine)
        moving = self._difference.update(smooth, frame.t_capture_ns, motion.affine)
        evidence = model.classify(smooth, moving)
        evidence = np.asarray(cv2.medianBlur(evidence, _MEDIAN_PX), np.uint8)
        self._dissolve(model, smooth, evidence, frame.t_capture_ns)
        self._free, protected_seq = self._protect(frame, feedback)
        model.learn(smooth, self._free)
        regions = find_regions(evidence, self._settings.min_blob_area_px)
        evidence = mark_moving(evidence, moving)
        learning = self._frames <= _LEARNING_FRAMES
        return Seen(evidence, regions, learning, protected_seq, motion)

    def _dissolve(
        self,
        model: CarriedBackground,
        smooth: NDArray[np.uint8],
        evidence: NDArray[np.uint8],
        t_ns: int,
    ) -> None:
        """Learn at once where somebody who was learned has walked away."""
        if not self._settings.dissolve_ghosts or self._frames % _GHOST_FRAMES:
            return
        if self._ghosts is None:
            self._ghosts = GhostFinder(evidence.shape[:2], t_ns)
        model.restart(smooth, self._ghosts.find(smooth, model.mean, foreground(evidence), t_ns))

    def _carried(
        self, motion: MotionEstimate, smooth: NDArray[np.uint8]
    ) -> CarriedBackground | None:
        """The model in this frame's pixels; None while the camera's motion is unknown.

        When it stays unknown the model starts over.
        """
        if self._model is not None and motion.is_known:
            self._lost_frames = 0
            self._model.move(motion.affine, smooth)
            return self._model
        self._lost_frames += 1
        if self._model is not None and self._lost_frames <= _LOST_FRAMES:
            return None
        self._frames, self._lost_frames = 1, 0
        self._model = CarriedBackground(
            smooth, self._settings.carried_sigmas, self._settings.shadow_ratio
        )
        if self._resumed is not None:
            self._model.resume(self._resumed)
            self._model.move(motion.affine, smooth)
            self._frames, self._resumed = _LEARNING_FRAMES, None
        return self._model

    def _protect(
        self, frame: FrameId, feedback: Tracks | None
    ) -> tuple[NDArray[np.uint8], int | None]:
        camera = None if feedback is None else self._path.since(feedback.seq)
        if feedback is None or camera is None:
            return free_mask(None, frame, self._size), None
        return free_mask(feedback, frame, self._size, camera), feedback.seq
