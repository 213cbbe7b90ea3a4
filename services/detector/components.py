"""From labelled pixels to regions: shadow removal, morphology, components, true-blob test."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from schemas.blobs import FOREGROUND, SHADOW
from services.detector.geometry import WorkSize
from services.detector.settings import DetectorSettings


@dataclass(frozen=True, slots=True)
class Region:
    """One connected region, in working pixels."""

    left: int
    top: int
    width: int
    height: int
    area: int
    centroid_x: float
    centroid_y: float


def find_regions(
    evidence: NDArray[np.uint8], size: WorkSize, settings: DetectorSettings
) -> list[Region]:
    """Regions of foreground that pass the true-blob test, largest first.

    Args:
        evidence: (H, W) uint8 of NONE, SHADOW and FOREGROUND; shadow counts as nothing.
        size: the working size of the frame.
        settings: kernels and thresholds.
    """
    mask = clean(person_pixels(evidence, settings.shadow_fill_fraction), settings)
    count, _, stats, centroids = cv2.connectedComponentsWithStats(mask, connectivity=8)
    regions = []
    for label in range(1, count):
        left, top, width, height, area = (int(value) for value in stats[label])
        x, y = (float(value) for value in centroids[label])
        region = Region(left, top, width, height, area, x, y)
        if is_true_blob(region, size, settings):
            regions.append(region)
    return sorted(regions, key=lambda region: (-region.area, region.left, region.top))


def person_pixels(evidence: NDArray[np.uint8], fill_fraction: float) -> NDArray[np.uint8]:
    """Foreground, and shadow that has foreground both above and below it; (H, W) of 0 and 1.

    Dark clothes look like shadow to MOG2, but a cast shadow has no person below it.

    Args:
        evidence: (H, W) uint8 of NONE, SHADOW and FOREGROUND.
        fill_fraction: tallest gap filled, share of the height; 0 leaves all shadow out.
    """
    foreground = np.asarray(evidence == FOREGROUND, np.uint8)
    gap = round(fill_fraction * evidence.shape[0])
    if gap < 1:
        return foreground
    kernel = np.ones((2 * (gap // 2) + 1, 1), np.uint8)
    bridged = cv2.morphologyEx(foreground, cv2.MORPH_CLOSE, kernel)
    return np.where((bridged > 0) & (evidence == SHADOW), np.uint8(1), foreground)


def clean(mask: NDArray[np.uint8], settings: DetectorSettings) -> NDArray[np.uint8]:
    """Opening, then closing, of a (H, W) mask of 0 and 1; a size of 0 leaves a step out."""
    steps = (
        (cv2.MORPH_OPEN, settings.open_width_px, settings.open_height_px),
        (cv2.MORPH_CLOSE, settings.close_width_px, settings.close_height_px),
    )
    for operation, width, height in steps:
        if width and height:
            kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, height))
            mask = np.asarray(cv2.morphologyEx(mask, operation, kernel), np.uint8)
    return mask


def is_true_blob(region: Region, size: WorkSize, settings: DetectorSettings) -> bool:
    """The paper's test, eq. 3 (box area above R * C / 100), with relative numbers.

    A share of the frame is the same at working size and at full size.
    """
    box_area = region.width * region.height
    return (
        box_area > settings.min_box_area_fraction * size.width * size.height
        and region.height >= settings.min_height_fraction * size.height
        and region.area >= settings.min_fill * box_area
    )
