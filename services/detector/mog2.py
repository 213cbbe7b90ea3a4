"""Foreground by OpenCV's MOG2 and the true-blob test: the detector of the paper, as printed.

Z. Zivkovic, "Improved adaptive Gaussian mixture model for background subtraction", ICPR 2004, eq. 1
and 2 of the paper: it selects the number of components by itself. Each frame is learned at once,
people and all. Where the paper prints no number it is OpenCV's own default.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import FrameId, Tracks
from heel.schemas.blobs import FOREGROUND, NONE, SHADOW
from heel.services.detector.background.evidence import Region, Seen, regions_of, smoothed
from heel.services.detector.scene import WorkSize
from heel.services.detector.settings import DetectorSettings

_HISTORY_FRAMES = 500  # OpenCV's default: memory; the learning rate falls to 1 by this
_VARIANCE_THRESHOLD = 16.0  # OpenCV's default: squared Mahalanobis distance of foreground
_DARKEST_SHADOW = 0.5  # OpenCV's default: share of the background's brightness
_LEARNING_FRAMES = 25  # after a start, in which the background is not believed; a second of video
_KERNEL_PX = {cv2.MORPH_OPEN: 3, cv2.MORPH_CLOSE: 5}  # chosen by hand: the paper prints none
_TRUE_BLOB_SHARE = 0.01  # eq. 3: area of a true blob's box above R * C / 100 pixels
_MOG2_SHADOW = 127  # OpenCV's label of shadows
_MOG2_FOREGROUND = 255  # OpenCV's label of foreground


class Mog2Foreground:
    """MOG2 of one scene."""

    name = "mog2"

    def __init__(self, size: WorkSize, settings: DetectorSettings) -> None:
        self._size = size
        self._blur_px = settings.blur_px
        self._mixture = cv2.createBackgroundSubtractorMOG2(
            _HISTORY_FRAMES, _VARIANCE_THRESHOLD, detectShadows=True
        )
        self._mixture.setShadowThreshold(_DARKEST_SHADOW)
        self._mixture.setShadowValue(_MOG2_SHADOW)
        self._frames = 0

    def look(self, image: NDArray[np.uint8], frame: FrameId, feedback: Tracks | None) -> Seen:
        """See and learn one frame; tracks are not looked at."""
        self._frames += 1
        # MOG2's own automatic rate.
        rate = 1.0 / min(2 * self._frames, _HISTORY_FRAMES)
        labels = self._mixture.apply(smoothed(image, self._blur_px), learningRate=rate)
        evidence = _evidence(labels)
        if self._frames == 1:
            # MOG2 calls its whole first frame foreground; there is nothing to compare it with.
            evidence.fill(NONE)
        learning = self._frames <= _LEARNING_FRAMES
        return Seen(evidence, true_blobs(evidence, self._size), learning, None)


def _evidence(labels: NDArray[Any]) -> NDArray[np.uint8]:
    evidence = np.full(labels.shape, NONE, np.uint8)
    evidence[labels == _MOG2_SHADOW] = SHADOW
    evidence[labels == _MOG2_FOREGROUND] = FOREGROUND
    return evidence


def true_blobs(labels: NDArray[np.uint8], size: WorkSize) -> list[Region]:
    """Regions of foreground, opened and closed, that pass the true-blob test, largest first.

    The paper's test, eq. 3, is of the whole frame; a share of it is the same at working size.

    Args:
        labels: (H, W) uint8 of NONE, SHADOW and FOREGROUND; shadow counts as nothing.
        size: the working size of the frame.
    """
    mask = np.asarray(labels == FOREGROUND, np.uint8)
    for operation, side_px in _KERNEL_PX.items():
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side_px, side_px))
        mask = np.asarray(cv2.morphologyEx(mask, operation, kernel), np.uint8)
    least_px2 = _TRUE_BLOB_SHARE * size.width * size.height
    return [region for region in regions_of(mask) if region.width * region.height > least_px2]
