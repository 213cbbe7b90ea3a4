"""Boxes: size, area, intersection over union, and the share of one box that lies in another.

A single box is a tuple left, top, right, bottom; many are a float array (N, 4) of the same, in the
precision of which everything is computed. All are in pixels, origin top-left, y down. A function of
single boxes has its name in the singular, the same of arrays in the plural or with `_matrix`: every
box of the first array with every box of the second. A box whose right or bottom edge lies before
its left or top one has no area.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy, Point

_F = TypeVar("_F", bound=np.floating[Any])

_LEAST_AREA_PX2 = 1e-9
"""Square pixels; areas are divided by no less, so that boxes without area have nothing in common
with any other instead of NaN."""


def width(box: BoxXyxy) -> float:
    """Width, pixels."""
    return box[2] - box[0]


def height(box: BoxXyxy) -> float:
    """Height, pixels."""
    return box[3] - box[1]


def centre(box: BoxXyxy) -> Point:
    """Centre, pixels."""
    return (box[0] + box[2]) / 2, (box[1] + box[3]) / 2


def area(box: BoxXyxy) -> float:
    """Area, square pixels."""
    return max(0.0, width(box)) * max(0.0, height(box))


def intersection(a: BoxXyxy, b: BoxXyxy) -> float:
    """Area that two boxes have in common, square pixels."""
    return area((max(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), min(a[3], b[3])))


def iou(a: BoxXyxy, b: BoxXyxy) -> float:
    """Intersection over union, 0 to 1; 0 of two boxes without area."""
    common = intersection(a, b)
    total = area(a) + area(b) - common
    return common / total if total > 0 else 0.0


def cover(inner: BoxXyxy, outer: BoxXyxy) -> float:
    """Share of `inner` that lies in `outer`, 0 to 1; 0 if `inner` has no area."""
    whole = area(inner)
    return intersection(inner, outer) / whole if whole > 0 else 0.0


def cover_of_smaller(a: BoxXyxy, b: BoxXyxy) -> float:
    """Share of the smaller of two boxes that lies in the other, 0 to 1."""
    smaller = min(area(a), area(b))
    return intersection(a, b) / smaller if smaller > 0 else 0.0


def holds(box: BoxXyxy, point: Point) -> bool:
    """Whether a point is in the box, its border included."""
    return box[0] <= point[0] <= box[2] and box[1] <= point[1] <= box[3]


def around(point: Point, box_width: float, box_height: float) -> BoxXyxy:
    """The box of this size around a centre."""
    x, y = point
    return x - box_width / 2, y - box_height / 2, x + box_width / 2, y + box_height / 2


def moved(box: BoxXyxy, dx: float, dy: float) -> BoxXyxy:
    """The box shifted by dx, dy pixels."""
    return box[0] + dx, box[1] + dy, box[2] + dx, box[3] + dy


def enclosing(boxes: Iterable[BoxXyxy]) -> BoxXyxy:
    """The smallest box around all of at least one."""
    lefts, tops, rights, bottoms = zip(*boxes, strict=True)
    return min(lefts), min(tops), max(rights), max(bottoms)


def kept_inside(box: BoxXyxy, outer: BoxXyxy) -> BoxXyxy:
    """`box` shifted so that it lies within `outer`, or centred on it where it is larger."""

    def shift(low: float, high: float, outer_low: float, outer_high: float) -> float:
        if high - low >= outer_high - outer_low:
            return (outer_low + outer_high - low - high) / 2
        return max(0.0, outer_low - low) + min(0.0, outer_high - high)

    return moved(
        box, shift(box[0], box[2], outer[0], outer[2]), shift(box[1], box[3], outer[1], outer[3])
    )


def as_array(boxes: Iterable[BoxXyxy]) -> NDArray[np.float64]:
    """Single boxes as one array (N, 4), also if there is none."""
    return np.array(list(boxes), np.float64).reshape(-1, 4)


def clipped(boxes: NDArray[_F], size: tuple[float, float]) -> NDArray[_F]:
    """The parts of (N, 4) boxes in a picture of this width and height; without area if none is."""
    return np.asarray(np.clip(boxes, 0.0, np.array([*size, *size], boxes.dtype)))


def areas(boxes: NDArray[_F]) -> NDArray[_F]:
    """Areas (N,) of (N, 4) boxes, square pixels."""
    return _product(boxes[:, 2:] - boxes[:, :2])


def intersection_matrix(first: NDArray[_F], second: NDArray[_F]) -> NDArray[_F]:
    """Area (N, M) that each of (N, 4) boxes has in common with each of (M, 4), square pixels."""
    top_left = np.maximum(first[:, None, :2], second[None, :, :2])
    bottom_right = np.minimum(first[:, None, 2:], second[None, :, 2:])
    return _product(bottom_right - top_left)


def iou_matrix(first: NDArray[_F], second: NDArray[_F]) -> NDArray[_F]:
    """Intersection over union (N, M), 0 to 1, of each of (N, 4) boxes and each of (M, 4)."""
    common = intersection_matrix(first, second)
    union = areas(first)[:, None] + areas(second)[None, :] - common
    return np.asarray(common / np.maximum(union, _LEAST_AREA_PX2))


def cover_matrix(inner: NDArray[_F], outer: NDArray[_F]) -> NDArray[_F]:
    """Share (N, M), 0 to 1, of each of (N, 4) boxes that lies in each of (M, 4)."""
    whole = np.maximum(areas(inner), _LEAST_AREA_PX2)
    return np.asarray(intersection_matrix(inner, outer) / whole[:, None])


def _product(extents: NDArray[_F]) -> NDArray[_F]:
    """Width times height of (..., 2) extents, 0 where either is negative."""
    extents = np.maximum(extents, 0.0)
    return np.asarray(extents[..., 0] * extents[..., 1])
