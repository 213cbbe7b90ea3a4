"""The background pixel by pixel: a Gaussian each, of a camera that stands or that moves.

Both models measure the distance from a mean in standard deviations, tell shadows from foreground,
start over where they are told to, and leave confirmed people out of what they learn. They differ
in what else a pixel remembers: behind a standing camera a second colour that may take the place of
the first, behind a moving one for how long the pixel has been in view.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.blobs import FOREGROUND, SHADOW
from heel.services.detector.background.evidence import Indices, Learned, indices_of
from heel.services.geometry.picture_motion import Affine

FloatMap = NDArray[np.float32]

STANDING_SIGMAS = 3.2
"""Distance from the background that is foreground, standard deviations; chosen by hand."""
MOVING_SIGMAS = 3.0
"""The same behind a moving camera, whose warp adds a tolerance of its own; chosen by hand."""
LEARNING_RATE_PER_S = 0.14
"""How fast a standing background follows the picture: daylight takes longer than 7 s to change."""
DARKEST_SHADOW = 0.7
"""Share of the background's brightness down to which a darker pixel may be a shadow on it."""
_BRIGHTEST_SHADOW = 0.97  # lighter than this share it is no shadow but noise; chosen by hand
_VARIANCE_CEILING = 900.0  # grey levels squared: a pixel that varies more would accept any colour
_MEAN_OF_CHANNELS = np.full((1, 3), 1.0 / 3.0, np.float32)  # as `cv2.transform` takes it


class PixelModel:
    """Mean and variance of each pixel at working size.

    Attributes:
        mean: (H, W, 3) float32, BGR.
        variance: (H, W) float32, grey levels squared.
    """

    def __init__(
        self, first: NDArray[np.uint8], initial_variance: float, shadow_chroma2: float
    ) -> None:
        """Take the first frame as the background.

        Args:
            first: (H, W, 3) uint8 BGR.
            initial_variance: of a pixel of which one frame is known, grey levels squared.
            shadow_chroma2: largest squared distance of a shadow from the background's own colour,
                grey levels squared.
        """
        self._initial_variance = initial_variance
        self._shadow_chroma2 = shadow_chroma2
        shape = first.shape[:2]
        self.mean: FloatMap = first.astype(np.float32)
        self.variance: FloatMap = np.full(shape, initial_variance, np.float32)
        # Fresh megabytes cost more in page faults than the arithmetic on them does.
        self._difference = np.empty_like(self.mean)
        self._distance2 = np.empty(shape, np.float32)

    def restart(self, image: NDArray[np.uint8], index: Indices) -> None:
        """Take the (H, W, 3) uint8 image as the background at these pixels."""
        self.mean.reshape(-1, 3)[index] = image.reshape(-1, 3)[index]
        self.variance.reshape(-1)[index] = self._initial_variance

    def _measure(self, image: NDArray[np.uint8]) -> None:
        """Squared distance from the mean, averaged over the channels, to `_distance2`."""
        np.copyto(self._difference, image)
        cv2.subtract(self._difference, self.mean, self._difference)
        cv2.multiply(self._difference, self._difference, self._difference)
        cv2.transform(self._difference, _MEAN_OF_CHANNELS, self._distance2)

    def _labels(self, image: NDArray[np.uint8], far: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """(H, W) uint8 of NONE, SHADOW and FOREGROUND where (H, W) uint8 `far` is 0 or 255."""
        evidence: NDArray[np.uint8] = far & np.uint8(FOREGROUND)
        index = indices_of(far)
        if index.size:
            pixels = image.reshape(-1, 3).take(index, 0).astype(np.float32)
            means = self.mean.reshape(-1, 3).take(index, 0)
            shadow = _is_shadow(pixels, means, self._shadow_chroma2)
            evidence.reshape(-1)[index[shadow]] = SHADOW
        return evidence


class StandingBackground(PixelModel):
    """Background of a standing camera: a mixture of two modes per pixel.

    C. Stauffer, W. Grimson, "Adaptive background mixture models for real-time tracking", CVPR 1999.
    The second mode is a challenger, which takes the place of the background once its weight is
    higher. OpenCV's MOG2 has one learning rate for the whole frame; here each pixel may wait.
    """

    _INITIAL_VARIANCE = 25.0  # grey levels squared; chosen by hand
    _VARIANCE_FLOOR = 9.0  # grey levels squared: camera noise on quiet pixels is no foreground
    _SHADOW_CHROMA2 = 81.0  # grey levels squared; chosen by hand
    _RESTART_WEIGHT = 0.1  # low, so that a wrong restart is soon challenged; chosen by hand
    _RESUMED_FRAMES = 25  # age that the background of another model counts as: a second of video
    _FASTEST_RATE = 0.5  # share of one frame in the mean, however long the last one is ago
    _CHALLENGER_RATE = 0.1
    """Least share of one frame in the challenger's mean: its colour is found in some ten frames."""

    def __init__(self, first: NDArray[np.uint8]) -> None:
        """Take the first frame, (H, W, 3) uint8 BGR, as the background."""
        super().__init__(first, self._INITIAL_VARIANCE, self._SHADOW_CHROMA2)
        self._threshold2 = STANDING_SIGMAS * STANDING_SIGMAS
        self._frames = 1
        shape = first.shape[:2]
        self._weight = np.ones(shape, np.float32)
        self._other_mean = self.mean.copy()
        self._other_weight = np.zeros(shape, np.float32)
        self._limit = np.empty(shape, np.float32)
        self._ones, self._zeros = np.ones(shape, np.float32), np.zeros(shape, np.float32)

    def classify(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """(H, W) uint8 of NONE, SHADOW and FOREGROUND for a (H, W, 3) uint8 frame."""
        self._measure(image)
        far = np.asarray(cv2.compare(self._distance2, self._limit, cv2.CMP_GT), np.uint8)
        return self._labels(image, far)

    def learn(self, image: NDArray[np.uint8], free: NDArray[np.uint8], dt_s: float) -> None:
        """Update from one frame.

        Args:
            image: (H, W, 3) uint8.
            free: (H, W) uint8, 255 where the frame may be learned, else 0.
            dt_s: seconds since the frame learned before.
        """
        self._frames += 1
        rate = max(1.0 - math.exp(-LEARNING_RATE_PER_S * dt_s), 1.0 / self._frames)
        rate = min(rate, self._FASTEST_RATE)
        self._measure(image)
        near = cv2.compare(self._distance2, self._limit, cv2.CMP_LE)
        matched = np.asarray(cv2.bitwise_and(near, free), np.uint8)
        cv2.accumulateWeighted(image, self.mean, rate, matched)
        cv2.accumulateWeighted(self._distance2, self.variance, 0.5 * rate, matched)
        np.clip(self.variance, self._VARIANCE_FLOOR, _VARIANCE_CEILING, out=self.variance)
        cv2.accumulateWeighted(self._ones, self._weight, rate, matched)
        cv2.accumulateWeighted(self._zeros, self._other_weight, rate, matched)
        index = indices_of(np.asarray(cv2.bitwise_xor(matched, free), np.uint8))
        if index.size:
            self._challenge(image.reshape(-1, 3).take(index, 0), index, rate)

    def resume(self, learned: Learned) -> None:
        """Go on with what another model has learned."""
        self.mean[:] = learned.mean
        np.clip(learned.variance, self._VARIANCE_FLOOR, _VARIANCE_CEILING, out=self.variance)
        self._frames = max(self._frames, self._RESUMED_FRAMES)

    def restart(self, image: NDArray[np.uint8], index: Indices) -> None:
        """As `PixelModel.restart`; a challenger soon wins against it."""
        super().restart(image, index)
        self._weight.reshape(-1)[index] = max(self._RESTART_WEIGHT, 1.0 / self._frames)
        self._other_weight.reshape(-1)[index] = 0.0

    def _measure(self, image: NDArray[np.uint8]) -> None:
        super()._measure(image)
        np.multiply(self.variance, self._threshold2, out=self._limit)

    def _challenge(self, colours: NDArray[np.uint8], index: Indices, rate: float) -> None:
        """Learn colours that are not the background at `index`; swap where they are as of now."""
        means, weights = self._other_mean.reshape(-1, 3), self._other_weight.reshape(-1)
        mean, weight = means.take(index, 0), weights.take(index)
        difference = colours - mean
        distance2 = np.einsum("ij,ij->i", difference, difference) / 3.0
        same = distance2 < self._threshold2 * self._INITIAL_VARIANCE
        step = np.where(same, max(rate, self._CHALLENGER_RATE), 1.0).astype(np.float32)
        mean += step[:, None] * difference
        weight = np.where(same, weight + rate * (1.0 - weight), rate).astype(np.float32)
        main = self._weight.reshape(-1)
        kept = main.take(index) * np.float32(1.0 - rate)
        wins = weight > kept
        means[index], weights[index], main[index] = mean, weight, kept
        swap = index[wins]
        self.mean.reshape(-1, 3)[swap] = mean[wins]
        self.variance.reshape(-1)[swap] = self._INITIAL_VARIANCE
        main[swap], weights[swap] = weight[wins], 0.0


class MovingBackground(PixelModel):
    """Background that is warped with the motion of the camera before each frame.

    As K. Yi et al., "Detection of moving objects with non-stationary cameras in 5.8 ms",
    CVPR-W 2013, but at full working resolution instead of by blocks, and with an error of warping
    that grows with the gradient of the picture.
    """

    _INITIAL_VARIANCE = 150.0
    """Grey levels squared, high: one frame of a moving camera says little; chosen by hand."""
    _VARIANCE_FLOOR = 20.0  # grey levels squared: interpolation adds to the camera noise
    _LEARNED_FLOOR = 4.0  # least squared distance that is learned as variance, grey levels squared
    _SHADOW_CHROMA2 = 144.0  # grey levels squared; chosen by hand
    _SLOWEST_RATE = 0.05
    """Share of one frame in the mean of an old pixel: errors of warping are to be forgotten."""
    _FOREGROUND_SHARE = 0.2  # of the learning rate, on foreground that no confirmed person explains
    _WARP_ERROR_PX = 0.5  # how far a warp is off; chosen by hand
    _RESUMED_FRAMES = 20.0
    """Age of pixels taken over from a standing background: 1 / `_SLOWEST_RATE`."""
    KNOWN_FRAMES = 3.0
    """A pixel that has been in view for fewer frames says nothing."""

    def __init__(self, first: NDArray[np.uint8]) -> None:
        """Take the first frame, (H, W, 3) uint8 BGR, as it is."""
        super().__init__(first, self._INITIAL_VARIANCE, self._SHADOW_CHROMA2)
        self._threshold2 = np.float32(MOVING_SIGMAS * MOVING_SIGMAS)
        self.age: FloatMap = np.zeros(first.shape[:2], np.float32)
        self._evidence = np.zeros(first.shape[:2], np.uint8)

    def resume(self, learned: Learned) -> None:
        """Go on with what another model has learned."""
        self.mean = learned.mean.copy()
        self.variance = learned.variance.copy()
        self.age[learned.known > 0] = self._RESUMED_FRAMES

    @property
    def learned(self) -> Learned:
        """What is known by now."""
        known = np.where(self.age >= self.KNOWN_FRAMES, np.uint8(255), np.uint8(0))
        return Learned(self.mean, self.variance, known)

    def warp(self, affine: Affine, image: NDArray[np.uint8]) -> None:
        """Follow the motion of the camera; what comes into view starts with the image.

        Args:
            affine: (2, 3), old to new working pixels.
            image: (H, W, 3) uint8, the new frame.
        """
        rows, columns = self.age.shape
        size = (columns, rows)
        # Four channels at once take a third of the time of three and one, with equal results.
        both = cv2.warpAffine(cv2.merge((self.mean, self.variance)), affine, size)
        cv2.mixChannels([both], [self.mean, self.variance], [0, 0, 1, 1, 2, 2, 3, 3])
        age = cv2.warpAffine(self.age + 1.0, affine, size, flags=cv2.INTER_NEAREST)
        self.age = np.maximum(np.asarray(age, np.float32) - 1.0, 0.0)
        self.restart(image, np.flatnonzero(np.asarray(age) < 0.5))

    def classify(self, image: NDArray[np.uint8], moving: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """(H, W) uint8 of NONE, SHADOW and FOREGROUND.

        Where the background is not known yet, what moves is foreground, and the background starts
        over there, so that people in view from the start do not become part of it.

        Args:
            image: (H, W, 3) uint8.
            moving: (H, W) uint8, 255 where it differs from the frames shortly before.
        """
        self._measure(image)
        limit = self._threshold2 * self._tolerance()
        far = np.asarray(cv2.compare(self._distance2, limit, cv2.CMP_GT), np.uint8)
        young = self.age < self.KNOWN_FRAMES
        np.copyto(far, moving, where=young)
        self.restart(image, np.flatnonzero(young & (moving > 0)))
        self._evidence = self._labels(image, far)
        return self._evidence

    def learn(self, image: NDArray[np.uint8], free: NDArray[np.uint8]) -> None:
        """Update from the frame that was classified last.

        Args:
            image: (H, W, 3) uint8.
            free: (H, W) uint8, 0 under confirmed people, else 255.
        """
        rate = np.maximum(1.0 / (self.age + 1.0), np.float32(self._SLOWEST_RATE))
        rate[self._evidence >= FOREGROUND] *= np.float32(self._FOREGROUND_SHARE)
        rate[free == 0] = 0.0
        change = cv2.subtract(image, self.mean, dtype=cv2.CV_32F)
        cv2.multiply(change, cv2.merge((rate, rate, rate)), change)
        cv2.add(self.mean, change, self.mean)
        step = np.clip(self._distance2, self._LEARNED_FLOOR, _VARIANCE_CEILING) - self.variance
        self.variance += 0.5 * rate * step
        self.age += np.minimum(rate * np.float32(1e6), np.float32(1.0))

    def restart(self, image: NDArray[np.uint8], index: Indices) -> None:
        """As `PixelModel.restart`; the pixels are not known yet."""
        super().restart(image, index)
        self.age.reshape(-1)[index] = 0.0

    def _tolerance(self) -> FloatMap:
        """Variance allowed: the pixel's own, and what a warp that is off by a little adds."""
        grey = np.asarray(cv2.transform(self.mean, _MEAN_OF_CHANNELS), np.float32)
        across = cv2.Sobel(grey, cv2.CV_32F, 1, 0, ksize=3, scale=0.125)
        down = cv2.Sobel(grey, cv2.CV_32F, 0, 1, ksize=3, scale=0.125)
        slope2 = cv2.multiply(across, across) + cv2.multiply(down, down)
        own = np.maximum(self.variance, np.float32(self._VARIANCE_FLOOR))
        return np.asarray(own + slope2 * np.float32(4.0 * self._WARP_ERROR_PX**2), np.float32)


def _is_shadow(pixels: FloatMap, means: FloatMap, chroma2: float) -> NDArray[np.bool_]:
    """(N,): which (N, 3) pixels are (N, 3) means, darker and of the same chromaticity.

    T. Horprasert, D. Harwood, L. Davis, "A statistical approach for real-time robust background
    subtraction and shadow detection", ICCV 1999.
    """
    norm = np.einsum("ij,ij->i", means, means) + 1.0
    ratio = np.einsum("ij,ij->i", pixels, means) / norm
    residual = pixels - ratio[:, None] * means
    distance2 = np.einsum("ij,ij->i", residual, residual)
    darker = (ratio > DARKEST_SHADOW) & (ratio < _BRIGHTEST_SHADOW)
    return np.asarray(darker & (distance2 < chroma2), np.bool_)
