"""Per-pixel Gaussian mixture of the background that does not learn protected pixels.

Two modes a pixel (C. Stauffer, W. Grimson, "Adaptive background mixture models for real-time
tracking", CVPR 1999): the background, and a challenger that takes its place once its weight is
higher. OpenCV's MOG2 takes one learning rate for the whole frame; here every pixel of a confirmed
person keeps its model untouched.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.blobs import FOREGROUND, SHADOW
from heel.services.detector.regions import Indices, Learned, indices_of
from heel.services.detector.shadow import is_shadow

FloatMap = NDArray[np.float32]

VARIANCE_FLOOR = 9.0
"""Grey levels squared: camera noise on quiet pixels is no foreground."""
_VARIANCE_CEILING = 900.0
_INITIAL_VARIANCE = 25.0
_RESTART_WEIGHT = 0.1
_RESUMED_FRAMES = 25
_SHADOW_CHROMA2 = 81.0
_MEAN_OF_CHANNELS = np.full((1, 3), 1.0 / 3.0, np.float32)


class BackgroundMixture:
    """Background of one static camera at working size. Maps are (H, W) float32."""

    def __init__(
        self, first: NDArray[np.uint8], sigmas: float, rate_per_s: float, shadow_ratio: float
    ) -> None:
        """Take the first frame as the background.

        Args:
            first: (H, W, 3) uint8 BGR.
            sigmas: distance in standard deviations, root mean square of channels, that is
                foreground.
            rate_per_s: exponential forgetting of weights, means and variances.
            shadow_ratio: darkest share of the background still called shadow.
        """
        self._threshold2 = sigmas * sigmas
        self._rate_per_s = rate_per_s
        self._shadow_ratio = shadow_ratio
        self._frames = 1
        shape = first.shape[:2]
        self.mean = first.astype(np.float32)
        self._variance = np.full(shape, _INITIAL_VARIANCE, np.float32)
        self._weight = np.ones(shape, np.float32)
        self._other_mean = self.mean.copy()
        self._other_weight = np.zeros(shape, np.float32)
        # Fresh megabytes cost more in page faults than the arithmetic on them does.
        self._pixels = np.empty_like(self.mean)
        self._distance2, self._limit = np.empty(shape, np.float32), np.empty(shape, np.float32)
        self._ones, self._zeros = np.ones(shape, np.float32), np.zeros(shape, np.float32)

    def classify(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """(H, W) uint8 of NONE, SHADOW and FOREGROUND for a (H, W, 3) uint8 frame."""
        self._measure(image)
        far = np.asarray(cv2.compare(self._distance2, self._limit, cv2.CMP_GT), np.uint8)
        evidence = far & np.uint8(FOREGROUND)
        index = indices_of(far)
        if index.size:
            pixels = image.reshape(-1, 3).take(index, 0).astype(np.float32)
            means = self.mean.reshape(-1, 3).take(index, 0)
            shadow = is_shadow(pixels, means, self._shadow_ratio, _SHADOW_CHROMA2)
            evidence.reshape(-1)[index[shadow]] = SHADOW
        return evidence

    def learn(self, image: NDArray[np.uint8], free: NDArray[np.uint8], dt_s: float) -> None:
        """Update from one frame.

        Args:
            image: (H, W, 3) uint8.
            free: (H, W) uint8, 255 where the frame may be learned, else 0.
            dt_s: seconds since the frame learned before.
        """
        self._frames += 1
        rate = max(1.0 - math.exp(-self._rate_per_s * dt_s), 1.0 / self._frames)
        rate = min(rate, 0.5)
        self._measure(image)
        near = cv2.compare(self._distance2, self._limit, cv2.CMP_LE)
        matched = np.asarray(cv2.bitwise_and(near, free), np.uint8)
        cv2.accumulateWeighted(image, self.mean, rate, matched)
        cv2.accumulateWeighted(self._distance2, self._variance, 0.5 * rate, matched)
        np.clip(self._variance, VARIANCE_FLOOR, _VARIANCE_CEILING, out=self._variance)
        cv2.accumulateWeighted(self._ones, self._weight, rate, matched)
        cv2.accumulateWeighted(self._zeros, self._other_weight, rate, matched)
        index = indices_of(np.asarray(cv2.bitwise_xor(matched, free), np.uint8))
        if index.size:
            self._challenge(image.reshape(-1, 3).take(index, 0), index, rate)

    @property
    def variance(self) -> FloatMap:
        """(H, W), grey levels squared."""
        return self._variance

    def resume(self, learned: Learned) -> None:
        """Go on with what another model has learned, as if it were a second old."""
        self.mean[:] = learned.mean
        np.clip(learned.variance, VARIANCE_FLOOR, _VARIANCE_CEILING, out=self._variance)
        self._frames = max(self._frames, _RESUMED_FRAMES)

    def restart(self, image: NDArray[np.uint8], index: Indices) -> None:
        """Take the image as the background at these pixels."""
        self.mean.reshape(-1, 3)[index] = image.reshape(-1, 3)[index]
        self._variance.reshape(-1)[index] = _INITIAL_VARIANCE
        self._weight.reshape(-1)[index] = max(_RESTART_WEIGHT, 1.0 / self._frames)
        self._other_weight.reshape(-1)[index] = 0.0

    def _measure(self, image: NDArray[np.uint8]) -> None:
        """Squared distance from the background, mean of channels, and how much is allowed."""
        np.copyto(self._pixels, image)
        cv2.subtract(self._pixels, self.mean, self._pixels)
        cv2.multiply(self._pixels, self._pixels, self._pixels)
        cv2.transform(self._pixels, _MEAN_OF_CHANNELS, self._distance2)
        np.multiply(self._variance, self._threshold2, out=self._limit)

    def _challenge(self, colours: NDArray[np.uint8], index: Indices, rate: float) -> None:
        """Learn colours that are not the background at `index`; swap where they are as of now."""
        means, weights = self._other_mean.reshape(-1, 3), self._other_weight.reshape(-1)
        mean, weight = means.take(index, 0), weights.take(index)
        difference = colours - mean
        distance2 = np.einsum("ij,ij->i", difference, difference) / 3.0
        same = distance2 < self._threshold2 * _INITIAL_VARIANCE
        step = np.where(same, max(rate, 0.1), 1.0).astype(np.float32)
        mean += step[:, None] * difference
        weight = np.where(same, weight + rate * (1.0 - weight), rate).astype(np.float32)
        main = self._weight.reshape(-1)
        kept = main.take(index) * np.float32(1.0 - rate)
        wins = weight > kept
        means[index], weights[index], main[index] = mean, weight, kept
        swap = index[wins]
        self.mean.reshape(-1, 3)[swap] = mean[wins]
        self._variance.reshape(-1)[swap] = _INITIAL_VARIANCE
        main[swap], weights[swap] = weight[wins], 0.0
