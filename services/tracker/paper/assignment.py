"""Kuhn-Munkres assignment of predicted boxes to blobs on their overlap."""

from __future__ import annotations

from collections.abc import Sequence

from heel.schemas.base import BoxXyxy
from heel.services.geometry.assignment import heaviest_pairs
from heel.services.geometry.boxes import as_array, iou_matrix


def assign(predicted: Sequence[BoxXyxy], seen: Sequence[BoxXyxy]) -> dict[int, int]:
    """Index in `predicted` to index in `seen`, of the greatest total IoU.

    Boxes that do not overlap are never paired.
    """
    if not predicted or not seen:
        return {}
    rows, columns = heaviest_pairs(iou_matrix(as_array(predicted), as_array(seen)), above=0.0)
    return dict(zip(rows.tolist(), columns.tolist(), strict=True))
