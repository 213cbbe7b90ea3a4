"""Regions to blobs with pixels, within the size cap of the message whatever the scene."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blob, Patch
from heel.services.detector.geometry import WorkSize
from heel.services.detector.regions import Region

PATCH_BUDGET_BYTES = 700_000
"""For all patches of a message; leaves room for evidence (250 kB) under its cap of 1 MiB."""


def pack(regions: Sequence[Region], image: NDArray[np.uint8], size: WorkSize) -> tuple[Blob, ...]:
    """Blobs in frame pixels, each with its patch in working pixels.

    When all patches together exceed the budget, all are shrunk by one common factor.

    Args:
        regions: at most `MAX_BLOBS` regions.
        image: (size.height, size.width, 3) uint8.
        size: the working size.
    """
    total = sum(3 * region.width * region.height for region in regions)
    factor = min(1.0, math.sqrt(PATCH_BUDGET_BYTES / total)) if total else 1.0
    return tuple(_blob(region, image, size, factor) for region in regions)


def _blob(region: Region, image: NDArray[np.uint8], size: WorkSize, factor: float) -> Blob:
    return Blob(
        box_xyxy=size.to_frame((region.left, region.top, region.width, region.height)),
        area_px=region.area * size.scale_x * size.scale_y,
        # A pixel's centre lies half a pixel inside its corner.
        centroid=(
            (region.centroid_x + 0.5) * size.scale_x,
            (region.centroid_y + 0.5) * size.scale_y,
        ),
        patch=Patch.from_array(_patch(region, image, factor)),
    )


def _patch(region: Region, image: NDArray[np.uint8], factor: float) -> NDArray[np.uint8]:
    rows = slice(region.top, region.top + region.height)
    columns = slice(region.left, region.left + region.width)
    pixels = image[rows, columns]
    if factor == 1.0:
        return pixels
    width, height = (max(1, int(side * factor)) for side in (region.width, region.height))
    return np.asarray(cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
