"""Whether somebody who looks alike has stepped in front: nobody comes much nearer at once."""

from __future__ import annotations

import math
from collections import deque

_LATELY_S = 0.6
_NEARER, _AS_BEFORE = 0.22, 0.2
"""ln of heights: nearer than lately, and as near as that. Twins who crossed in front at 1 m of
somebody 1.7 m away were taller by 0.29 to 0.45 within that time; a robot that closes up with
somebody who walks makes them taller by 0.1."""
_NEAR = 0.45
"""Picture heights of somebody about 2 m away. Farther off sizes are corrected as fast as that."""
_LONGEST_S = 2.0
"""Who has been nearer for so long, and nobody else is where they were, has come nearer."""


class Doubt:
    """Compares a person's height with what it was lately."""

    def __init__(self) -> None:
        self._lately: deque[tuple[float, float]] = deque()
        self._before = 0.0
        self._t_s = 0.0
        self._until_s = -math.inf

    def raised(self, height: float, dt_s: float) -> bool:
        """Take in the height of a frame; whether it may be somebody else's.

        Args:
            height: picture heights.
            dt_s: since the frame before.
        """
        self._t_s += dt_s
        now = math.log(height)
        if self._t_s < self._until_s and now - self._before > _NEARER:
            return True
        self._until_s = -math.inf
        while self._lately and self._t_s - self._lately[0][0] > _LATELY_S:
            self._lately.popleft()
        self._before = min((before for _, before in self._lately), default=now)
        self._lately.append((self._t_s, now))
        if height < _NEAR or now - self._before <= _NEARER:
            return False
        self._until_s = self._t_s + _LONGEST_S
        self._lately.clear()
        return True

    def as_before(self, height: float) -> bool:
        """Whether somebody so high is as near as the person was lately."""
        return abs(math.log(height) - self._before) < _AS_BEFORE
