"""The background: an adaptive Gaussian mixture per pixel, with people kept out of it.

OpenCV's MOG2 is Z. Zivkovic, "Improved adaptive Gaussian mixture model for background
subtraction", ICPR 2004, eq. 1 and 2 of the paper: it selects the number of components by itself.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.blobs import FOREGROUND, NONE, SHADOW

_MOG2_SHADOW, _MOG2_FOREGROUND = 127, 255


class BackgroundModel:
    """MOG2 that can leave some pixels unlearned."""

    def __init__(self, history_frames: int, variance_threshold: float, shadow_ratio: float) -> None:
        """Start with nothing known; the first frame becomes the background.

        Args:
            history_frames: memory; the learning rate falls to 1 / history_frames.
            variance_threshold: squared Mahalanobis distance that makes a pixel foreground.
            shadow_ratio: darkest share of the background still called shadow.
        """
        self._mixture = cv2.createBackgroundSubtractorMOG2(
            history_frames, variance_threshold, detectShadows=True
        )
        self._mixture.setShadowThreshold(shadow_ratio)
        self._mixture.setShadowValue(_MOG2_SHADOW)
        self._history_frames = history_frames
        self._frames = 0

    def classify(
        self, image: NDArray[np.uint8], protected: NDArray[np.bool_] | None
    ) -> NDArray[np.uint8]:
        """Label every pixel and learn the frame.

        MOG2 takes one learning rate for the whole frame. So with protection the frame is labelled
        without learning, and what is learned is a composite in which the protected pixels show
        the model's own background.

        Args:
            image: (H, W, 3) uint8.
            protected: (H, W) bool, pixels that must not be learned; None for none.

        Returns:
            (H, W) uint8 of NONE, SHADOW and FOREGROUND.
        """
        rate = self._next_rate()
        if self._frames == 1:
            # MOG2 calls its whole first frame foreground; there is nothing to compare it with.
            self._mixture.apply(image, learningRate=rate)
            return np.full(image.shape[:2], NONE, np.uint8)
        if protected is None or not protected.any():
            return _evidence(self._mixture.apply(image, learningRate=rate))
        labels = self._mixture.apply(image, learningRate=0.0)
        background = self._mixture.getBackgroundImage()
        composite = np.where(protected[..., None], background, image)
        self._mixture.apply(composite, learningRate=rate)
        return _evidence(labels)

    def _next_rate(self) -> float:
        # MOG2's own automatic rate, which counts every call and would count our two as two frames.
        self._frames += 1
        return 1.0 / min(2 * self._frames, self._history_frames)


def _evidence(labels: NDArray[Any]) -> NDArray[np.uint8]:
    evidence = np.full(labels.shape, NONE, np.uint8)
    evidence[labels == _MOG2_SHADOW] = SHADOW
    evidence[labels == _MOG2_FOREGROUND] = FOREGROUND
    return evidence
