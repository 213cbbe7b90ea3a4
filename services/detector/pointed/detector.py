"""Boxes of the person a user pointed at."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from services.detector.camera_motion import EgoMotion, MotionEstimate
from services.detector.pointed.contrast import contrast_box
from services.detector.pointed.outline import outline_box
from services.detector.pointed.person import Person, Sighting

_FORGET_S = 30.0
_MARGIN = 0.1
"""Of a box, left out of the camera's motion, heights."""


class PointedAt:
    """Looks for one person: whoever was pointed at last.

    Attributes:
        count: of the people looked for so far.
    """

    def __init__(self) -> None:
        """Nobody was pointed at yet."""
        self.count = 0
        self._person: Person | None = None
        self._ego = EgoMotion()
        self._last_ns: int | None = None

    @property
    def somebody(self) -> bool:
        """Whether somebody is being looked for."""
        return self._person is not None

    def point(self, smooth: NDArray[np.uint8], x_px: float, y_px: float) -> bool:
        """Look for whoever is at a point from now on; False where nobody's shape is.

        Args:
            smooth: (H, W, 3) uint8 BGR at working size, as the next `look` gets it.
            x_px, y_px: working pixels.
        """
        box = contrast_box(smooth, x_px, y_px)
        if box is None:
            return False
        if self._person is None:
            self._ego, self._last_ns = EgoMotion(), None
        self.count += 1
        self._person = Person(outline_box(smooth, box), smooth.shape[0])
        return True

    def look(self, smooth: NDArray[np.uint8], t_ns: int) -> tuple[Sighting | None, MotionEstimate]:
        """Where they are in this frame if they are seen, and how the camera has moved.

        Args:
            smooth: (H, W, 3) uint8 BGR at working size; kept, not to be written to afterwards.
            t_ns: its time.
        """
        assert self._person is not None
        dt_s = 0.0 if self._last_ns is None else max(0.0, (t_ns - self._last_ns) * 1e-9)
        self._last_ns = t_ns
        grey = np.asarray(cv2.cvtColor(smooth, cv2.COLOR_BGR2GRAY), np.uint8)
        motion = self._ego.update(grey, self._free(self._person, grey.shape))
        sighting = self._person.look(smooth, motion.affine, dt_s)
        if self._person.missed_s > _FORGET_S:
            self._person = None
        return sighting, motion

    @staticmethod
    def _free(person: Person, shape: tuple[int, ...]) -> NDArray[np.uint8]:
        """Where nobody is, as `estimate_motion` takes it."""
        free = np.full(shape[:2], 255, np.uint8)
        left, top, right, bottom = person.box_xyxy
        margin = _MARGIN * (bottom - top)
        rows = slice(max(0, int(top - margin)), max(0, int(bottom + margin)))
        free[rows, max(0, int(left - margin)) : max(0, int(right + margin))] = 0
        return free
