"""Which colours are a person's, strip by strip, and which are the background's beside it.

Histograms of both and their ratio, after M. Swain, D. Ballard, "Color indexing", IJCV 1991, and
R. Collins, Y. Liu, M. Leordeanu, "Online selection of discriminative tracking features", PAMI 2005.
Changes of light and exposure are taken out of the pictures before.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.services.detector.pointed.silhouette import STRIPS, FloatMap

_LIGHT_BINS = 8  # of Lab's lightness: the coarsest, since light changes most
_HUE_BINS = 16  # of Lab's a and b each
_BINS = _LIGHT_BINS * _HUE_BINS * _HUE_BINS
_HUE_STEP = 4  # Lab's a and b of one bin; most colours of a picture lie within 32 of grey
_KEPT_SHARE = 0.6  # of a bin's weight that stays in it along one axis; chosen by hand
_SPREAD_SHARE = 0.2  # of a bin's weight that each neighbour along one axis gets; chosen by hand
_FLOOR = 0.002  # share of a colour below which neither person nor background is said to have it
_COVERED = 0.6  # pixels covered more than this are the person's
_UNCOVERED = 0.1  # pixels covered less than this are beside it
_LEAST_PIXELS = 4.0  # a histogram of fewer pixels says nothing; chosen by hand

_EXPOSURE_SIZE = (40, 30)  # pictures are reduced to this before their light is compared, pixels
_DARKEST = 8  # grey levels below it say little about light
_BRIGHTEST = 250  # grey levels above it are saturated
_LEAST_SHARE = 0.2  # of the pixels that have to say something about light
_MEMORY_S = 10.0
"""Ratios from frame to frame drift when they are multiplied: they are forgotten so slowly."""
_LARGEST_GAIN = 3.0  # beyond it the picture holds too little to be brought back
_IGNORED_GAIN = 1.02  # not worth another picture


def colour_bins(image: NDArray[np.uint8]) -> NDArray[np.int32]:
    """(H, W) int32 bin of each pixel of (H, W, 3) uint8 BGR."""
    lab = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2LAB), np.uint8)
    light = (lab[..., 0] >> 5).astype(np.int32)
    hues = np.clip((lab[..., 1:].astype(np.int32) - 128) // _HUE_STEP + _HUE_BINS // 2, 0, 15)
    return (light * _HUE_BINS + hues[..., 0]) * _HUE_BINS + hues[..., 1]


def _histogram(bins: NDArray[np.int32], weights: FloatMap) -> FloatMap:
    """Weighted share of each colour, with some of it given to its neighbours."""
    counts = np.bincount(bins.ravel(), weights.ravel(), _BINS).astype(np.float32)
    cube = counts.reshape(_LIGHT_BINS, _HUE_BINS, _HUE_BINS)
    for axis in range(3):
        near = np.zeros_like(cube)
        ahead = [slice(None)] * 3
        behind = [slice(None)] * 3
        ahead[axis], behind[axis] = slice(1, None), slice(None, -1)
        near[tuple(ahead)] += cube[tuple(behind)]
        near[tuple(behind)] += cube[tuple(ahead)]
        cube = _KEPT_SHARE * cube + _SPREAD_SHARE * near
    total = float(cube.sum())
    return cube.reshape(-1) / total if total > 0.0 else cube.reshape(-1)


class StripColours:
    """Colours of one person and of what is beside them; (STRIPS, bins) float32 each."""

    def __init__(self) -> None:
        self._person = np.zeros((STRIPS, _BINS), np.float32)
        self._beside = np.zeros((STRIPS, _BINS), np.float32)
        self._first = np.zeros((STRIPS, _BINS), np.float32)
        self._known = False

    def learn(
        self, bins: NDArray[np.int32], cover: FloatMap, rows: list[slice],
        person_rate: float, beside_rate: float,
    ) -> None:  # fmt: skip
        """Take in the colours of now.

        Args:
            bins: (H, W) of `colour_bins`.
            cover: (H, W) float32, 1 on the person, 0 beside, nan where neither is sure.
            rows: of each strip.
            person_rate: share of the new in what is known of the person; all at first.
            beside_rate: the same for what is beside.
        """
        if not self._known:
            person_rate = beside_rate = 1.0
            self._known = True
        body = np.where(cover > _COVERED, cover, 0.0).astype(np.float32)
        beside = np.where(cover < _UNCOVERED, 1.0, 0.0).astype(np.float32)
        for strip, span in enumerate(rows):
            wide = slice(max(0, 2 * span.start - span.stop), 2 * span.stop - span.start)
            for known, part, weights, rate in (
                (self._person, span, body, person_rate),
                (self._beside, wide, beside, beside_rate),
            ):
                if rate > 0.0 and weights[part].sum() > _LEAST_PIXELS:
                    now = _histogram(bins[part], weights[part])
                    known[strip] += np.float32(rate) * (now - known[strip])

    def keep(self) -> None:
        """Remember for good how the person looks now."""
        self._first = self._person.copy()

    def likeness(self, bins: NDArray[np.int32]) -> list[FloatMap]:
        """By strip, (H, W) float32 in [-1, 1]: the background's, or this person's there."""
        person = 0.5 * (self._person + self._first) + _FLOOR
        beside = self._beside + _FLOOR
        ratio = (person - beside) / (person + beside)
        return [np.take(ratio[strip], bins) for strip in range(STRIPS)]


class Exposure:
    """How much lighter the picture is than it was at first."""

    def __init__(self) -> None:
        self._before: NDArray[np.float32] | None = None
        self._log_gain = 0.0

    def level(self, image: NDArray[np.uint8], dt_s: float) -> NDArray[np.uint8]:
        """The picture as it would be in the light of the beginning.

        Args:
            image: (H, W, 3) uint8 BGR.
            dt_s: since the picture before.
        """
        small = cv2.resize(image, _EXPOSURE_SIZE, interpolation=cv2.INTER_AREA)
        grey = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), np.float32)
        before, self._before = self._before, grey
        if before is not None:
            told = (
                (grey > _DARKEST)
                & (before > _DARKEST)
                & (grey < _BRIGHTEST)
                & (before < _BRIGHTEST)
            )
            if np.count_nonzero(told) > _LEAST_SHARE * grey.size:
                self._log_gain += float(np.median(np.log(grey[told] / before[told])))
        self._log_gain *= math.exp(-dt_s / _MEMORY_S)
        gain = min(max(math.exp(self._log_gain), 1.0 / _LARGEST_GAIN), _LARGEST_GAIN)
        if 1.0 / _IGNORED_GAIN < gain < _IGNORED_GAIN:
            return image
        table = np.clip(np.arange(256) / gain, 0, 255).astype(np.uint8)
        return np.asarray(cv2.LUT(image, table), np.uint8)
