"""Does the camera stand still?"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.services.detector.camera_motion import (
    Affine,
    MotionEstimate,
    compose,
    estimate_motion,
)

_REDUCTION = 2
MOVED_PX = 0.8
"""Root mean square shift of the picture's corners that a standing camera never has, working px:
the six static recordings reach 0.5."""
_STILL_SHARE = 0.2
"""When the camera moves, fewer corners than this stay where they were: those near its axis."""
_ANCHOR_S = 1.0
STANDING_S, _STOOD_PX = 1.5, 0.5


class StandingWatch:
    """Compares each frame with one up to a second old, so that a slow pan is seen, too.

    At half the working size and once a frame it costs about 1 ms.
    """

    def __init__(self) -> None:
        self._anchor: _Anchor | None = None

    def update(
        self, grey: NDArray[np.uint8], free: NDArray[np.uint8], t_ns: int
    ) -> MotionEstimate | None:
        """Motion since the anchor where the camera has moved, else None.

        Args:
            grey: (H, W) uint8, this frame.
            free: (H, W) uint8, 0 where people are, else 255.
            t_ns: time of the frame.
        """
        small = _reduced(grey)
        anchor = self._anchor
        if anchor is None or t_ns - anchor.t_ns > _ANCHOR_S * 1e9 or t_ns < anchor.t_ns:
            self._anchor = _Anchor(small, _reduced(free), t_ns)
        if anchor is None:
            return None
        motion = estimate_motion(anchor.grey, small, anchor.free)
        affine = motion.affine.copy()
        affine[:, 2] *= _REDUCTION
        since = MotionEstimate(affine, motion.quality)
        rows, columns = grey.shape
        moved = since.is_known and since.shift_px(columns, rows) > MOVED_PX
        return since if moved and motion.still < _STILL_SHARE else None


@dataclass(frozen=True, slots=True, eq=False)
class _Anchor:
    grey: NDArray[np.uint8]
    free: NDArray[np.uint8]
    t_ns: int


class RestWatch:
    """Says when a camera that moved has come to rest."""

    def __init__(self, columns: int, rows: int) -> None:
        self._size = (columns, rows)
        self._past: deque[tuple[int, Affine]] = deque(maxlen=512)
        self._total: Affine = np.eye(2, 3)

    def update(self, motion: MotionEstimate, t_ns: int) -> bool:
        """Whether the camera has not moved for `STANDING_S`."""
        if not motion.is_known:
            self._past.clear()
            return False
        self._total = compose(motion.affine, self._total)
        self._past.append((t_ns, self._total))
        while len(self._past) > 1 and t_ns - self._past[1][0] >= STANDING_S * 1e9:
            self._past.popleft()
        if t_ns - self._past[0][0] < STANDING_S * 1e9:
            return False
        return all(self._shift_px(then) < _STOOD_PX for _, then in self._past)

    def _shift_px(self, then: Affine) -> float:
        back = np.asarray(cv2.invertAffineTransform(then), np.float64)
        return MotionEstimate(compose(self._total, back), 1.0).shift_px(*self._size)


def _reduced(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.ascontiguousarray(image[::_REDUCTION, ::_REDUCTION])
