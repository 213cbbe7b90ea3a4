"""The paper's occlusion tests: blob count, area and aspect ratio (eq. 4)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from heel.schemas.base import BoxXyxy
from heel.services.geometry import boxes

Occlusion = Literal["none", "self", "inter_object"]


def aspect_ratio(box: BoxXyxy) -> float:
    """The paper's AR = s^2 / A with span s (width) and area A of the box: width over height."""
    area = boxes.area(box)
    return boxes.width(box) ** 2 / area if area > 0 else 0.0


def is_occlusion(before: BoxXyxy, now: BoxXyxy, threshold: float = 0.5) -> bool:
    """Equation 4: either of two consecutive boxes is wider than a person alone."""
    return aspect_ratio(before) > threshold or aspect_ratio(now) > threshold


def classify(
    count_before: int,
    count_now: int,
    hidden: Sequence[BoxXyxy],
    blob: BoxXyxy,
    threshold: float = 0.5,
) -> Occlusion:
    """Which occlusion a blob shows, as printed.

    Args:
        count_before: blobs in the frame before.
        count_now: blobs in this frame.
        hidden: boxes in the frame before of the people now under `blob`, at least one.
        blob: the blob in this frame.
        threshold: of eq. 4.

    Returns:
        "inter_object" when the count fell, the blob is larger than each person's and eq. 4 holds;
        "self" when the count is equal and eq. 4 holds; else "none".
    """
    if not any(is_occlusion(box, blob, threshold) for box in hidden):
        return "none"
    if count_now == count_before:
        return "self"
    larger = all(boxes.area(blob) > boxes.area(box) for box in hidden)
    return "inter_object" if count_now < count_before and larger else "none"
