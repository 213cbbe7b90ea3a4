"""How near a person is, told by its size: where it stands then, and whether it can be that near."""

from __future__ import annotations

import math
from collections import deque

_LOWEST = 0.25  # least part of a person below the horizon: of eyes 0.4 m above the floor
_HIGHEST = 0.62  # largest part of a person below the horizon: of eyes 1.1 m above the floor
_HORIZON_RATE = 0.02
"""Share of a difference by which the horizon is corrected a frame; chosen by hand."""
_HORIZON_REACH = 0.12
"""Its greatest distance from the middle row, picture heights: a pitch of 5 degrees or so."""

_LATELY_S = 0.6  # time over which heights are compared; chosen by hand
_NEARER = 0.22
"""ln of heights: nearer than lately. A person that crosses in front, half as far away, is taller by
more; a robot that closes up with one that walks makes it taller by 0.1."""
_AS_BEFORE = 0.2  # ln of heights: as near as lately
_NEAR = 0.45
"""Picture heights of a person about 2 m away. Farther off sizes are corrected as fast as that."""
_LONGEST_S = 2.0
"""A person that has looked larger for so long, while nobody is at the old place, has come nearer;
chosen by hand."""


class Stance:
    """Where a person of some height stands in the picture of a camera that is level, or nearly so.

    Feet are below the horizon and heads above it in the same proportion at any distance, as long as
    floor and camera keep their heights (A. Criminisi, I. Reid, A. Zisserman, "Single view
    metrology", IJCV 2000). Kept are the horizon and which part of the person is below it.
    """

    def __init__(self, rows: int, top: float, bottom: float) -> None:
        """From one box, with the horizon in the middle of the picture.

        Args:
            rows: of the picture, pixels.
            top, bottom: of the person, pixels.
        """
        self._middle = 0.5 * rows
        self._reach = _HORIZON_REACH * rows
        self.horizon = self._middle
        share = (bottom - self.horizon) / (bottom - top)
        self._below = min(max(share, _LOWEST), _HIGHEST)

    def centre(self, height: float) -> float:
        """Row of the middle of the box of a person so high."""
        return self.horizon + (self._below - 0.5) * height

    def height(self, top: float | None, bottom: float | None, before: float) -> float | None:
        """From the head or the feet, None if neither is known.

        Colours go on into shadows below the feet, and into what is behind the head: of two, the
        one nearer to the height before is told.

        Args:
            top, bottom: rows of head and feet, pixels.
            before: height, pixels.
        """
        told = [height for height in self._heights(top, bottom) if height is not None]
        return min(told, key=lambda height: abs(math.log(height / before)), default=None)

    def _heights(
        self, top: float | None, bottom: float | None
    ) -> tuple[float | None, float | None]:
        by_head = by_feet = None
        if top is not None and top < self.horizon:
            by_head = (self.horizon - top) / (1.0 - self._below)
        if bottom is not None and bottom > self.horizon:
            by_feet = (bottom - self.horizon) / self._below
        return by_head, by_feet

    def least_height(self, top: float | None, bottom: float | None) -> float:
        """Of a person that the picture's border cuts off there; 0 for where it does not."""
        told = self._heights(top, bottom)
        return max((height for height in told if height is not None), default=0.0)

    def correct(self, centre: float, height: float) -> None:
        """Learn the horizon from the row at which the clothes lie."""
        horizon = self.horizon + _HORIZON_RATE * (centre - self.centre(height))
        low, high = self._middle - self._reach, self._middle + self._reach
        self.horizon = min(max(horizon, low), high)


class Doubt:
    """Tells whether another person that looks alike has stepped in front.

    Nobody comes much nearer at once: the height is compared with what it was lately.
    """

    def __init__(self) -> None:
        self._lately: deque[tuple[float, float]] = deque()
        self._before = 0.0
        self._t_s = 0.0
        self._until_s = -math.inf

    def raised(self, height: float, dt_s: float) -> bool:
        """Take in the height of a frame; whether it may be another person's.

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
        """Whether a person so high is as near as the person was lately."""
        return abs(math.log(height) - self._before) < _AS_BEFORE
