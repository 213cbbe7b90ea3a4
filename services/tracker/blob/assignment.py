"""Kuhn-Munkres assignment of predicted boxes to blobs on their overlap.

H. W. Kuhn, 1955; J. Munkres, 1957; scipy solves it by the method of Jonker and Volgenant.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from heel.schemas.base import BoxXyxy
from heel.services.geometry import boxes


def assign(predicted: Sequence[BoxXyxy], seen: Sequence[BoxXyxy]) -> dict[int, int]:
    """Index in `predicted` to index in `seen`, of the greatest total IoU.

    Boxes that do not overlap are never paired.
    """
    if not predicted or not seen:
        return {}
    scores = np.array([[boxes.iou(box, other) for other in seen] for box in predicted])
    rows, columns = solve(-scores)
    return {
        int(row): int(column)
        for row, column in zip(rows, columns, strict=True)
        if scores[row, column] > 0.0
    }


def solve(costs: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of the assignment of least total cost."""
    rows, columns = linear_sum_assignment(costs)
    return rows, columns
