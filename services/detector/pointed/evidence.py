"""Whether a place that was pointed at is a person: told by what moves there, and how."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy
from heel.services.detector.pointed.movement import Movement, MovementWatch

_QUIET_PX = 100
"""Fewer pixels than this that move are nobody."""
_OFF_AXIS, _LEAST_INSIDE, _MOST_BESIDE = 0.15, 0.55, 0.5
_LEGS = 0.72
"""Who walks moves their legs: so far down movement reaches, from head (0) to foot (1)."""
_HEAD = 0.35
"""And so far up: something smaller within a larger box is not who the box is about."""
_FROM_ASIDE, _OUTSIDE = 0.28, 0.3
"""Movement that begins so far off the axis, or with so little inside, comes in from a side."""
_PASSES, _ALONG = 0.08, 0.3
"""Pixels that go so far, heights, while the box goes less than this share of it, pass by."""
_SLIDES = 0.03
"""A box that goes so far, heights, while its pixels do not go the same way, slides over a wall."""
_NEEDED_S, _NEEDED_AFTER_OTHERS_S = 0.35, 1.2
"""How long they have to walk; longer, where it began with somebody from aside: who passes by at
1 m/s is before a body for half a second."""
_QUIET_S = 0.3
_LONGEST_STEP_S = 0.2
"""For so long at most does one frame stand."""


class Evidence:
    """Gathers evidence of one person, frame by frame.

    Who stands and then walks begins to move in the middle of their box; who merely passes by it
    comes in from a side. After movement that began so, more is needed until all is quiet.
    """

    def __init__(self) -> None:
        self._watch = MovementWatch()
        self._walked_s = 0.0
        self._quiet_s = _QUIET_S
        self._began = self._somebody_else = False
        self._last_s: float | None = None

    @property
    def proves(self) -> bool:
        """Whether it suffices to drive after them."""
        needed_s = _NEEDED_AFTER_OTHERS_S if self._somebody_else else _NEEDED_S
        return self._walked_s >= needed_s

    def look(
        self, grey: NDArray[np.uint8], box: BoxXyxy, free: NDArray[np.uint8], t_s: float
    ) -> None:
        """Take in a frame; arguments as `MovementWatch.look`."""
        dt_s = 0.0 if self._last_s is None else min(max(0.0, t_s - self._last_s), _LONGEST_STEP_S)
        self._last_s = t_s
        movement = self._watch.look(grey, box, free, t_s)
        if movement is None or self.proves:
            return
        if movement.pixels < _QUIET_PX:
            self._quiet_s += dt_s
            self._walked_s = max(0.0, self._walked_s - 0.5 * dt_s)
            self._began = self._began and self._walked_s > 0.0
            if self._somebody_else and self._quiet_s >= _QUIET_S:
                self._somebody_else, self._walked_s = False, 0.0
            return
        self._quiet_s = 0.0
        if not _walks(movement, (grey.shape[0] - box[1]) / (box[3] - box[1])):
            from_aside = abs(movement.aside) > _FROM_ASIDE or movement.inside < _OUTSIDE
            self._somebody_else = self._somebody_else or (from_aside and not self._began)
            self._walked_s = max(0.0, self._walked_s - 0.5 * dt_s)
        else:
            self._began = True
            self._walked_s += dt_s


def _walks(movement: Movement, visible: float) -> bool:
    """Whether it is the one in the box who moves, from the legs up.

    Args:
        movement: about the box.
        visible: part of the body, from the head on, above the picture's lower border.
    """
    step = movement.body_step
    passes_by = abs(step) > _PASSES and movement.box_step * step < _ALONG * step * step
    slides = abs(movement.box_step) > _SLIDES and movement.box_step * step <= 0.0
    return (
        abs(movement.aside) < _OFF_AXIS
        and movement.inside > _LEAST_INSIDE
        and movement.beside < _MOST_BESIDE
        and movement.highest < _HEAD
        and movement.lowest > _LEGS * min(visible, 1.0)
        and not passes_by
        and not slides
    )
