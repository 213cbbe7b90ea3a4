"""Names for the arrays that the fitted tracker passes around."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
FloatMap = NDArray[np.float32]
Floats = NDArray[np.float64]
Box = tuple[float, float, float, float]
"""xyxy, working pixels."""
Foot = tuple[float, float]
"""Where somebody stands: bottom centre of the box, working pixels."""


def box_at(foot: Foot, height: float, ratio: float) -> Box:
    """The box of a person who stands there; `ratio` is width by height."""
    x, y = foot
    half = 0.5 * ratio * height
    return x - half, y - height, x + half, y


def carried(foot: Foot, affine: Floats) -> Foot:
    """A point moved by (2, 3) `affine`."""
    x, y = affine[:, :2] @ foot + affine[:, 2]
    return float(x), float(y)


def overlap(a: Box, b: Box) -> tuple[float, float]:
    """Intersection over union of two boxes, and intersection over the first."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0.0 or height <= 0.0:
        return 0.0, 0.0
    common = width * height
    first, second = ((box[2] - box[0]) * (box[3] - box[1]) for box in (a, b))
    return common / (first + second - common), common / first
