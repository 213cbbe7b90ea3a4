"""Arithmetic on boxes xyxy, float pixels."""

from __future__ import annotations

from collections.abc import Iterable

from heel.schemas.base import BoxXyxy, Point


def width(box: BoxXyxy) -> float:
    """Width, pixels."""
    return box[2] - box[0]


def height(box: BoxXyxy) -> float:
    """Height, pixels."""
    return box[3] - box[1]


def area(box: BoxXyxy) -> float:
    """Area, square pixels; 0 for an inside-out box."""
    return max(0.0, width(box)) * max(0.0, height(box))


def centre(box: BoxXyxy) -> Point:
    """Centre, pixels."""
    return (box[0] + box[2]) / 2, (box[1] + box[3]) / 2


def around(point: Point, box_width: float, box_height: float) -> BoxXyxy:
    """The box of this size around a centre."""
    x, y = point
    return x - box_width / 2, y - box_height / 2, x + box_width / 2, y + box_height / 2


def moved(box: BoxXyxy, dx: float, dy: float) -> BoxXyxy:
    """The box shifted by dx, dy pixels."""
    return box[0] + dx, box[1] + dy, box[2] + dx, box[3] + dy


def union(boxes: Iterable[BoxXyxy]) -> BoxXyxy:
    """The smallest box around all of at least one."""
    lefts, tops, rights, bottoms = zip(*boxes, strict=True)
    return min(lefts), min(tops), max(rights), max(bottoms)


def intersection(a: BoxXyxy, b: BoxXyxy) -> float:
    """Common area, square pixels."""
    return area((max(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), min(a[3], b[3])))


def iou(a: BoxXyxy, b: BoxXyxy) -> float:
    """Intersection over union, 0 to 1."""
    common = intersection(a, b)
    total = area(a) + area(b) - common
    return common / total if total > 0 else 0.0


def cover(inner: BoxXyxy, outer: BoxXyxy) -> float:
    """Share of `inner` that lies in `outer`, 0 to 1."""
    return intersection(inner, outer) / area(inner) if area(inner) > 0 else 0.0


def kept_inside(box: BoxXyxy, outer: BoxXyxy) -> BoxXyxy:
    """`box` shifted so that it lies within `outer`, or centred on it where it is larger."""

    def shift(low: float, high: float, outer_low: float, outer_high: float) -> float:
        if high - low >= outer_high - outer_low:
            return (outer_low + outer_high - low - high) / 2
        return max(0.0, outer_low - low) + min(0.0, outer_high - high)

    return moved(
        box, shift(box[0], box[2], outer[0], outer[2]), shift(box[1], box[3], outer[1], outer[3])
    )
