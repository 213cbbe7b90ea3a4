"""Names for the arrays of the evidence front end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
FloatMap = NDArray[np.float32]
Floats = NDArray[np.float64]
Box = tuple[float, float, float, float]
"""xyxy, working pixels."""
Foot = tuple[float, float]
"""Where a person stands: bottom centre of the box, working pixels."""


def box_at(foot: Foot, height: float, ratio: float) -> Box:
    """The box of a person that stands there; `ratio` is width by height."""
    x, y = foot
    half = 0.5 * ratio * height
    return x - half, y - height, x + half, y
