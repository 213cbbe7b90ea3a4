"""Where somebody of some height stands in the picture of a camera that is level, or nearly so.

Feet are below the horizon and heads above it in the same proportion at any distance, as long as
floor and camera keep their heights (A. Criminisi, I. Reid, A. Zisserman, "Single view metrology",
IJCV 2000).
"""

from __future__ import annotations

_LOWEST, _HIGHEST = 0.25, 0.62
"""Part of a person below the horizon: of eyes 0.4 to 1.1 m above the floor."""
_HORIZON_RATE, _HORIZON_REACH = 0.02, 0.12
"""Share of a difference by which the horizon is corrected a frame, and its greatest distance from
the middle row, picture heights: a pitch of 5 degrees or so."""


class Stance:
    """The horizon, and which part of one person is below it."""

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
        """Row of the middle of the box of somebody so high."""
        return self.horizon + (self._below - 0.5) * height

    def height(self, top: float | None, bottom: float | None) -> float | None:
        """From the head, else from the feet, which stand in shadows; None if neither is known."""
        if top is not None and top < self.horizon:
            return (self.horizon - top) / (1.0 - self._below)
        if bottom is not None and bottom > self.horizon:
            return (bottom - self.horizon) / self._below
        return None

    def least_height(self, top: float | None, bottom: float | None) -> float:
        """Of somebody whom the picture's border cuts off there; 0 for where it does not."""
        told = (self.height(top, None), self.height(None, bottom))
        return max((height for height in told if height is not None), default=0.0)

    def correct(self, centre: float, height: float) -> None:
        """Learn the horizon from the row at which somebody's clothes lie."""
        horizon = self.horizon + _HORIZON_RATE * (centre - self.centre(height))
        low, high = self._middle - self._reach, self._middle + self._reach
        self.horizon = min(max(horizon, low), high)
