"""How much boxes have in common."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Boxes = NDArray[np.floating[Any]]
"""(N, 4) xyxy."""


def intersection(first: Boxes, second: Boxes) -> Boxes:
    """Common area of every box with every other, (N, M)."""
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    return np.asarray(np.clip(high - low, 0, None).prod(axis=2))


def area(boxes: Boxes) -> Boxes:
    """(N,)."""
    return np.asarray((boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1]))


def iou(first: Boxes, second: Boxes) -> Boxes:
    """Intersection over union of every box with every other, (N, M) in [0, 1]."""
    common = intersection(first, second)
    union = area(first)[:, None] + area(second)[None] - common
    return np.asarray(common / np.maximum(union, 1e-9))
