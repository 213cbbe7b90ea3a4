"""Half width of an upright person from head to foot: one table for all who look for that shape."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Places from head (0) to foot (1), and the half width there averaged over the steps of a walk, in
# widths of the box; read by hand off outlines of people.
_AT = (0.0, 0.04, 0.12, 0.20, 0.35, 0.50, 0.65, 0.80, 0.95, 1.0)
_HEAD_TO_KNEE = (0.08, 0.17, 0.20, 0.36, 0.42, 0.40, 0.33)

LEGS_OF_WALKERS = (0.36, 0.42, 0.30)
"""Half widths at the last three places, box widths, of people who walk across the view: the feet
of a stride are as wide apart as the shoulders. Chosen by hand."""
LEGS_TOGETHER = (0.30, 0.32, 0.25)
"""The same of a person who stands, or walks to or from the camera. Chosen by hand."""


@dataclass(frozen=True)
class Outline:
    """An upright person's outline.

    Attributes:
        legs: half widths of the lower legs, box widths.
        beyond: how far the outline goes on above the head and below the feet, heights.
        outside: half width there and farther out, box widths; below 0 where not even soft sides
            are to reach in.
    """

    legs: tuple[float, float, float]
    beyond: float
    outside: float

    def half_width(self, down: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
        """Half width in box widths at places from head (0) to foot (1); below 0: no body."""
        at = (-self.beyond, *_AT, 1.0 + self.beyond)
        width = (self.outside, *_HEAD_TO_KNEE, *self.legs, self.outside)
        return np.asarray(np.interp(down, at, width))
