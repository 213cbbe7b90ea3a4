"""Where the feet of people who stand are seen by a camera whose mounting nobody stated.

Feet at distance `d` are seen at a slope of `fall / d + offset` below the optical axis: `fall` is
the camera's height and `offset` its pitch, on the scale of whatever height is assumed of people.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class GroundLine:
    """A camera's ground.

    Attributes:
        fall_m: height of the camera, above 0.
        offset: slope of the horizon; below 0 for a camera that looks down.
    """

    fall_m: float
    offset: float

    def distance_m(self, slope: float) -> float:
        """How far away feet are that are seen at a slope; infinite at and above the horizon."""
        below = slope - self.offset
        return self.fall_m / below if below > 1e-6 else math.inf
