"""From labelled pixels to regions: shadow removal, morphology, components, true-blob test."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.blobs import FOREGROUND, SHADOW
from heel.services.detector.geometry import WorkSize
from heel.services.detector.mog2.numbers import Mog2Numbers
from heel.services.detector.regions import Region, regions_of


def find_regions(evidence: NDArray[np.uint8], size: WorkSize, numbers: Mog2Numbers) -> list[Region]:
    """Regions of foreground that pass the true-blob test, largest first.

    Args:
        evidence: (H, W) uint8 of NONE, SHADOW and FOREGROUND; shadow counts as nothing.
        size: the working size of the frame.
        numbers: kernels and thresholds.
    """
    mask = clean(person_pixels(evidence, numbers.shadow_fill_fraction), numbers)
    return [region for region in regions_of(mask) if is_true_blob(region, size, numbers)]


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


def clean(mask: NDArray[np.uint8], numbers: Mog2Numbers) -> NDArray[np.uint8]:
    """Opening, then closing, of a (H, W) mask of 0 and 1; a size of 0 leaves a step out."""
    steps = (
        (cv2.MORPH_OPEN, numbers.open_px),
        (cv2.MORPH_CLOSE, numbers.close_px),
    )
    for operation, kernel_px in steps:
        if all(kernel_px):
            kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, kernel_px)
            mask = np.asarray(cv2.morphologyEx(mask, operation, kernel), np.uint8)
    return mask


def is_true_blob(region: Region, size: WorkSize, numbers: Mog2Numbers) -> bool:
    """The paper's test, eq. 3 (box area above R * C / 100), with relative numbers.

    A share of the frame is the same at working size and at full size.
    """
    box_area = region.width * region.height
    return (
        box_area > numbers.min_box_area_fraction * size.width * size.height
        and region.height >= numbers.min_height_fraction * size.height
        and region.area >= numbers.min_fill * box_area
    )
