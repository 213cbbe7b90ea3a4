"""People to blobs with their pixels."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blob, Patch
from heel.schemas.base import BoxXyxy
from heel.services.detector.neural.between import Seen
from heel.services.detector.packing import PATCH_BUDGET_BYTES

_PATCH_ROWS = 96
"""Patches are reduced to at most this height: enough for the colours of clothes."""


def person_blobs(people: Sequence[Seen], image: NDArray[np.uint8]) -> tuple[Blob, ...]:
    """A blob for everybody, patches cut from (H, W, 3) uint8 BGR."""
    most_pixels = PATCH_BUDGET_BYTES // (3 * max(1, len(people)))
    return tuple(_blob(person, image, most_pixels) for person in people)


def _blob(person: Seen, image: NDArray[np.uint8], most_pixels: int) -> Blob:
    left, top, right, bottom = person.box_xyxy
    return Blob(
        box_xyxy=person.box_xyxy,
        area_px=(right - left) * (bottom - top),
        centroid=((left + right) / 2, (top + bottom) / 2),
        patch=Patch.from_array(_patch(image, person.box_xyxy, most_pixels)),
        score=person.score,
    )


def _patch(image: NDArray[np.uint8], box: BoxXyxy, most_pixels: int) -> NDArray[np.uint8]:
    rows, columns = image.shape[:2]
    left = min(max(0, int(box[0])), columns - 1)
    top = min(max(0, int(box[1])), rows - 1)
    right, bottom = max(left + 1, round(box[2])), max(top + 1, round(box[3]))
    pixels = image[top:bottom, left:right]
    height, width = pixels.shape[:2]
    scale = min(1.0, _PATCH_ROWS / height, math.sqrt(most_pixels / (height * width)))
    if scale == 1.0:
        return pixels
    size = (max(1, int(width * scale)), max(1, int(height * scale)))
    return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
