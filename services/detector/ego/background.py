"""Background model that is warped along with the camera.

Mean, variance and age per pixel, moved by the camera's motion before each frame, as K. Yi et al.,
"Detection of moving objects with non-stationary cameras in 5.8 ms", CVPR-W 2013, but at full
working resolution instead of by blocks, with an error of warping that grows with the picture's own
gradient, and with people left out of learning.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.blobs import FOREGROUND, SHADOW
from heel.services.detector.camera_motion import Affine
from heel.services.detector.regions import Indices, Learned, indices_of
from heel.services.detector.shadow import is_shadow

FloatMap = NDArray[np.float32]

KNOWN_FRAMES = 3.0
"""A pixel that has been in view for fewer frames says nothing."""
_NEW_VARIANCE = 150.0
_VARIANCE_FLOOR, _VARIANCE_CEILING = 20.0, 900.0
_LEARNED_FLOOR = 4.0
_SLOWEST = 0.05
_RESUMED_FRAMES = 20.0
_FOREGROUND_SHARE = 0.2
"""Of the learning rate, on foreground that no confirmed person explains."""
_WARP_ERROR_PX = 0.5
_SHADOW_CHROMA2 = 144.0
_MEAN_OF_CHANNELS = np.full((1, 3), 1.0 / 3.0, np.float32)


class CarriedBackground:
    """Background of one moving camera at working size. Maps are (H, W) float32."""

    def __init__(self, first: NDArray[np.uint8], sigmas: float, shadow_ratio: float) -> None:
        """Take the first frame as it is.

        Args:
            first: (H, W, 3) uint8 BGR.
            sigmas: distance in standard deviations that is foreground.
            shadow_ratio: darkest share of the background still called shadow.
        """
        self._threshold2 = np.float32(sigmas * sigmas)
        self._shadow_ratio = shadow_ratio
        shape = first.shape[:2]
        self.mean: FloatMap = first.astype(np.float32)
        self._variance: FloatMap = np.full(shape, _NEW_VARIANCE, np.float32)
        self.age: FloatMap = np.zeros(shape, np.float32)
        self._distance2: FloatMap = np.zeros(shape, np.float32)
        self._evidence = np.zeros(shape, np.uint8)

    def resume(self, learned: Learned) -> None:
        """Go on with what another model has learned."""
        self.mean = learned.mean.copy()
        self._variance = learned.variance.copy()
        self.age[learned.known > 0] = _RESUMED_FRAMES

    @property
    def learned(self) -> Learned:
        """What is known by now."""
        known = np.where(self.age >= KNOWN_FRAMES, np.uint8(255), np.uint8(0))
        return Learned(self.mean, self._variance, known)

    def move(self, affine: Affine, image: NDArray[np.uint8]) -> None:
        """Move the model by the camera's motion; what comes into view starts with the image.

        Args:
            affine: (2, 3), old to new working pixels.
            image: (H, W, 3) uint8, the new frame.
        """
        rows, columns = self.age.shape
        size = (columns, rows)
        # Four channels at once take a third of the time of three and one, with equal results.
        both = cv2.warpAffine(cv2.merge((self.mean, self._variance)), affine, size)
        cv2.mixChannels([both], [self.mean, self._variance], [0, 0, 1, 1, 2, 2, 3, 3])
        age = cv2.warpAffine(self.age + 1.0, affine, size, flags=cv2.INTER_NEAREST)
        self.age = np.maximum(np.asarray(age, np.float32) - 1.0, 0.0)
        self.restart(image, np.flatnonzero(np.asarray(age) < 0.5))

    def classify(self, image: NDArray[np.uint8], moving: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """(H, W) uint8 of NONE, SHADOW and FOREGROUND.

        Where the background is not known yet, what moves is foreground, and the background starts
        over there: nobody in view from the start, or shown by a turn, becomes part of it.

        Args:
            image: (H, W, 3) uint8.
            moving: (H, W) uint8, 255 where it differs from the frames shortly before.
        """
        difference = cv2.subtract(image.astype(np.float32), self.mean)
        squares = cv2.multiply(difference, difference)
        self._distance2 = np.asarray(cv2.transform(squares, _MEAN_OF_CHANNELS), np.float32)
        limit = self._threshold2 * self._tolerance()
        far = np.asarray(cv2.compare(self._distance2, limit, cv2.CMP_GT), np.uint8)
        young = self.age < KNOWN_FRAMES
        np.copyto(far, moving, where=young)
        self.restart(image, np.flatnonzero(young & (moving > 0)))
        evidence: NDArray[np.uint8] = far & np.uint8(FOREGROUND)
        index = indices_of(far)
        if index.size:
            pixels = image.reshape(-1, 3).take(index, 0).astype(np.float32)
            means = self.mean.reshape(-1, 3).take(index, 0)
            shadow = is_shadow(pixels, means, self._shadow_ratio, _SHADOW_CHROMA2)
            evidence.reshape(-1)[index[shadow]] = SHADOW
        self._evidence = evidence
        return evidence

    def learn(self, image: NDArray[np.uint8], free: NDArray[np.uint8]) -> None:
        """Update from the frame that was classified last.

        Args:
            image: (H, W, 3) uint8.
            free: (H, W) uint8, 0 under confirmed people, else 255.
        """
        rate = np.maximum(1.0 / (self.age + 1.0), np.float32(_SLOWEST))
        rate[self._evidence >= FOREGROUND] *= np.float32(_FOREGROUND_SHARE)
        rate[free == 0] = 0.0
        change = cv2.subtract(image, self.mean, dtype=cv2.CV_32F)
        cv2.multiply(change, cv2.merge((rate, rate, rate)), change)
        cv2.add(self.mean, change, self.mean)
        step = np.clip(self._distance2, _LEARNED_FLOOR, _VARIANCE_CEILING) - self._variance
        self._variance += 0.5 * rate * step
        self.age += np.minimum(rate * np.float32(1e6), np.float32(1.0))

    def restart(self, image: NDArray[np.uint8], index: Indices) -> None:
        """Take the image as a background that is not known yet at these pixels."""
        self.mean.reshape(-1, 3)[index] = image.reshape(-1, 3)[index]
        self._variance.reshape(-1)[index] = _NEW_VARIANCE
        self.age.reshape(-1)[index] = 0.0

    def _tolerance(self) -> FloatMap:
        """Variance allowed: the pixel's own, and what a warp that is off by a little does."""
        grey = np.asarray(cv2.transform(self.mean, _MEAN_OF_CHANNELS), np.float32)
        across = cv2.Sobel(grey, cv2.CV_32F, 1, 0, ksize=3, scale=0.125)
        down = cv2.Sobel(grey, cv2.CV_32F, 0, 1, ksize=3, scale=0.125)
        slope2 = cv2.multiply(across, across) + cv2.multiply(down, down)
        own = np.maximum(self._variance, np.float32(_VARIANCE_FLOOR))
        return np.asarray(own + slope2 * np.float32(4.0 * _WARP_ERROR_PX**2), np.float32)
