"""The arrays of the evidence front end, and what all of its parts do with them."""

from __future__ import annotations

import cv2
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


def shrunk(evidence: FloatMap, step: int) -> FloatMap:
    """(H, W) reduced by a whole factor, which is much faster than resizing to a rounded size."""
    if step == 1:
        return evidence
    columns, rows = max(evidence.shape[1] // step, 1), max(evidence.shape[0] // step, 1)
    whole = evidence[: rows * step, : columns * step]
    return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA), np.float32)
