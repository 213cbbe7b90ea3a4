"""Foreground of one scene, against a background of a camera that stands or that moves.

Behind a standing camera a frame is learned late, when its own tracks are here. Behind a moving one
it is learned at once, with the tracks of an earlier frame warped to it: a frame that waited would
have to be warped again and again.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import FrameId, Tracks
from heel.services.detector.background.evidence import (
    FrameDifference,
    Indices,
    Learned,
    Seen,
    find_regions,
    foreground,
    mark_moving,
    smoothed,
    without_specks,
)
from heel.services.detector.background.learning import GhostFinder, LateFrames, StillnessGate
from heel.services.detector.background.pixel_model import MovingBackground, StandingBackground
from heel.services.detector.feedback import free_mask
from heel.services.detector.scene import WorkSize
from heel.services.detector.settings import DetectorSettings
from heel.services.geometry.picture_motion import CameraPath, EgoMotion, MotionEstimate

_GHOST_FRAMES = 3  # ghosts are looked for in every third frame: they stay, and looking takes time
_LEARNING_FRAMES = 4
"""Frames after which a moving background is to be believed: pixels are known after three."""
_LOST_FRAMES = 5
"""Frames without known motion after which a moving background starts over; chosen by hand."""


class StandingForeground:
    """Foreground before a camera that stands: classify, correct, learn late, find ghosts."""

    name = "mixture"

    def __init__(
        self, size: WorkSize, settings: DetectorSettings, learned: Learned | None = None
    ) -> None:
        """Start with nothing known, or with what another model has learned."""
        self._learned = learned
        self._size = size
        self._settings = settings
        self._difference = FrameDifference()
        self._frames = 0

    @property
    def learned(self) -> Learned:
        """What is known by now; only after the first frame."""
        return Learned(self._model.mean, self._model.variance, self._gate.known)

    def look(self, image: NDArray[np.uint8], frame: FrameId, feedback: Tracks | None) -> Seen:
        """See one frame; learn those whose tracks are here."""
        smooth, t_ns = smoothed(image, self._settings.blur_px), frame.t_capture_ns
        self._frames += 1
        if self._frames == 1:
            self._start(smooth, t_ns)
        protected_seq = self._learn(feedback)
        labels = self._model.classify(smooth)
        moving = self._difference.update(smooth, t_ns)
        self._restart(smooth, self._gate.settle(moving, t_ns))
        labels = without_specks(self._gate.correct(labels, moving))
        evidence = mark_moving(labels, moving)
        if self._settings.dissolve_ghosts and self._frames % _GHOST_FRAMES == 0:
            mask = foreground(evidence)
            self._restart(smooth, self._ghosts.find(smooth, self._model.mean, mask, t_ns))
        if self._frames > 1:
            self._late.add(frame, smooth)
        regions = find_regions(evidence, self._settings.min_blob_area_px)
        return Seen(evidence, regions, self._gate.learning, protected_seq)

    def _start(self, smooth: NDArray[np.uint8], t_ns: int) -> None:
        settings, shape = self._settings, (self._size.height, self._size.width)
        self._model = StandingBackground(smooth)
        known = None
        if self._learned is not None:
            self._model.resume(self._learned)
            known, self._learned = self._learned.known, None
        self._gate = StillnessGate(shape, t_ns, settings.startup_s, known)
        self._ghosts = GhostFinder(shape, t_ns)
        self._late = LateFrames(self._size, settings.feedback_lag_frames, t_ns)

    def _learn(self, feedback: Tracks | None) -> int | None:
        protected_seq = None
        for late in self._late.due(feedback):
            self._model.learn(late.image, self._gate.allow(late.free), late.dt_s)
            protected_seq = late.protected_seq
        return protected_seq

    def _restart(self, smooth: NDArray[np.uint8], index: Indices) -> None:
        self._model.restart(smooth, index)
        self._late.forget(index)


class MovingForeground:
    """Foreground before a camera that moves: estimate its motion, warp the background, compare."""

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
        self._ghosts = GhostFinder((size.height, size.width))
        self._model: MovingBackground | None = None
        self._frames = 0
        self._lost_frames = 0
        self._free = free_mask(None, None, size)

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
        smooth, t_ns = smoothed(image, self._settings.blur_px), frame.t_capture_ns
        self._frames += 1
        grey = np.asarray(cv2.cvtColor(smooth, cv2.COLOR_BGR2GRAY), np.uint8)
        motion = self._ego.update(grey, self._free)
        motion = motion if first_motion is None else first_motion
        model = self._warped(motion, smooth)
        if model is None:
            return Seen(None, [], False, None, motion, "the camera's motion cannot be told")
        self._path.add(frame.seq, motion.affine)
        self._ghosts.warp(motion.affine)
        moving = self._difference.update(smooth, t_ns, motion.affine)
        evidence = mark_moving(without_specks(model.classify(smooth, moving)), moving)
        if self._settings.dissolve_ghosts and self._frames % _GHOST_FRAMES == 0:
            mask = foreground(evidence)
            model.restart(smooth, self._ghosts.find(smooth, model.mean, mask, t_ns))
        camera = None if feedback is None else self._path.since(feedback.seq)
        protecting = None if camera is None else feedback
        self._free = free_mask(protecting, frame, self._size, camera)
        model.learn(smooth, self._free)
        regions = find_regions(evidence, self._settings.min_blob_area_px)
        learning = self._frames <= _LEARNING_FRAMES
        protected_seq = None if protecting is None else protecting.seq
        return Seen(evidence, regions, learning, protected_seq, motion)

    def _warped(self, motion: MotionEstimate, smooth: NDArray[np.uint8]) -> MovingBackground | None:
        """The model in the pixels of this frame; None while the camera's motion is unknown.

        When it stays unknown the model starts over.
        """
        if self._model is not None and motion.is_known:
            self._lost_frames = 0
            self._model.warp(motion.affine, smooth)
            return self._model
        self._lost_frames += 1
        if self._model is not None and self._lost_frames <= _LOST_FRAMES:
            return None
        self._frames, self._lost_frames = 1, 0
        self._model = MovingBackground(smooth)
        if self._resumed is not None:
            self._model.resume(self._resumed)
            self._model.warp(motion.affine, smooth)
            self._frames, self._resumed = _LEARNING_FRAMES, None
        return self._model
