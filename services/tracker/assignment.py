"""Kuhn-Munkres assignment of predicted boxes to blobs on a matching score, with a gate.

H. W. Kuhn, 1955; J. Munkres, 1957; scipy solves it by the method of Jonker and Volgenant.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from schemas.base import BoxXyxy
from services.tracker import boxes
from services.tracker.settings import TrackerSettings


def matching_score(predicted: BoxXyxy, seen: BoxXyxy, settings: TrackerSettings) -> float:
    """How well two boxes match, 0 to 1: IoU, mixed with nearness of the centres."""
    nearness = 0.0
    if settings.proximity_weight:
        reach_px = settings.proximity_reach * boxes.height(predicted)
        nearness = max(0.0, 1.0 - boxes.distance(predicted, seen) / reach_px)
    overlap = boxes.iou(predicted, seen)
    return settings.proximity_weight * nearness + (1 - settings.proximity_weight) * overlap


def assign(
    predicted: Sequence[BoxXyxy], seen: Sequence[BoxXyxy], settings: TrackerSettings
) -> dict[int, int]:
    """Index in `predicted` to index in `seen`, of the greatest total score.

    Pairs whose score is not above `settings.min_score` are never made.
    """
    if not predicted or not seen:
        return {}
    scores = np.array([[matching_score(box, other, settings) for other in seen]
                       for box in predicted])  # fmt: skip
    allowed = scores > settings.min_score
    rows, columns = solve(np.where(allowed, -scores, 0.0))
    return {
        int(row): int(column)
        for row, column in zip(rows, columns, strict=True)
        if allowed[row, column]
    }


def solve(costs: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of the assignment of least total cost."""
    rows, columns = linear_sum_assignment(costs)
    return rows, columns
