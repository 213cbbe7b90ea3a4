"""Whether somebody who looks alike has stepped in front: nobody comes much nearer at once."""

from __future__ import annotations

import math

_MEMORY_S = 0.6
_NEARER, _AS_BEFORE = 0.22, 0.2
"""ln of heights: nearer than lately, and as near as that. Twins who crossed in front at 1 m of
somebody 1.6 m away were taller by 0.28 to 0.45 within 0.4 s."""
_NEAR = 0.45
"""Picture heights of somebody about 2 m away. Farther off sizes are corrected as fast as that."""
_LONGEST_S = 2.0
"""Who has been nearer for so long, and nobody else is where they were, has come nearer."""


class Doubt:
    """Compares a person's height with what it was lately."""

    def __init__(self) -> None:
        self._lately: float | None = None
        self._doubted_s = 0.0

    def raised(self, height: float, dt_s: float) -> bool:
        """Take in the height of a frame; whether it may be somebody else's.

        Args:
            height: picture heights.
            dt_s: since the frame before.
        """
        now = math.log(height)
        if self._lately is None:
            self._lately = now
        nearer = height > _NEAR and now - self._lately > _NEARER
        if nearer and self._doubted_s < _LONGEST_S:
            self._doubted_s += dt_s
            return True
        if self._doubted_s >= _LONGEST_S:
            self._lately = now
        self._doubted_s = 0.0
        self._lately += (1.0 - math.exp(-dt_s / _MEMORY_S)) * (now - self._lately)
        return False

    def as_before(self, height: float) -> bool:
        """Whether somebody so high is as near as the person was lately."""
        return self._lately is not None and abs(math.log(height) - self._lately) < _AS_BEFORE
