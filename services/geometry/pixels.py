"""Any decoded picture to the one format the rest of Heel takes, and smaller."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.errors import SourceError
from heel.schemas.image import MAX_IMAGE_BYTES


def to_bgr8(image: NDArray[np.integer | np.floating]) -> NDArray[np.uint8]:
    """A picture as contiguous (H, W, 3) uint8 BGR.

    Args:
        image: (H, W), (H, W, 1), (H, W, 3) BGR or (H, W, 4) BGRA; uint8, or uint16 of which the
            upper eight bits are kept.

    Raises:
        SourceError: another shape or sample type.
    """
    if image.dtype == np.uint16:
        image = (image.astype(np.uint16) >> 8).astype(np.uint8)
    channels = 1 if image.ndim == 2 else image.shape[-1]
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or image.size == 0:
        raise SourceError(
            f"picture of shape {image.shape} and type {image.dtype}: 8 or 16 bit grey, BGR or BGRA "
            "is needed"
        )
    if channels == 3:
        return np.ascontiguousarray(image, np.uint8)
    if channels == 1:
        return np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), np.uint8)
    if channels == 4:
        return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGRA2BGR), np.uint8)
    raise SourceError(f"picture with {channels} channels: 1, 3 or 4 are needed")


def scaled_size(width: int, height: int, scale: float) -> tuple[int, int]:
    """Width and height after scaling, rounded, at least one pixel each."""
    return max(1, round(width * scale)), max(1, round(height * scale))


def shrink(image: NDArray[np.uint8], scale: float) -> NDArray[np.uint8]:
    """(H, W, 3) scaled by 0 < scale <= 1; INTER_AREA, since others alias when shrinking."""
    height, width = image.shape[:2]
    size = scaled_size(width, height, scale)
    if size == (width, height):
        return image
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def fit_to_cap(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The image itself, or shrunk so that its raw pixels fit into one message.

    8K raw is 100 MB; the cap is 8 MiB (1080p is 6.2 MB).
    """
    if image.nbytes <= MAX_IMAGE_BYTES:
        return image
    return shrink(image, math.sqrt(MAX_IMAGE_BYTES / image.nbytes) * 0.999)
