"""Appearance descriptors of boxes: colours of five bands of the body, all boxes at once.

One colour histogram per body band, compared by the Hellinger distance. Histograms are soft: a pixel
is shared between neighbouring bins, so that a slight change of light moves a descriptor only
slightly.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.services.geometry.histograms import soft_counts
from heel.services.tracker.people.geometry import FloatArray

Patch = NDArray[np.uint8]
"""(H, W, 3) uint8 BGR pixels under a box."""

_WIDTH = 12
"""Columns [px] to which every patch is brought; twice the size takes four times as long.
Chosen by hand."""
_HEIGHT = 24
"""Rows [px] to which every patch is brought, twice `_WIDTH`, as a standing person; chosen by
hand."""
_BANDS = ((1, 4), (4, 8), (8, 13), (13, 18), (18, 23))
"""Rows of head, chest, hips, thighs and shins, each from one to before another; chosen by hand."""
_LIGHTS = 8
"""Bins of lightness, each of 32 of its 256 levels; chosen by hand."""
_HUES = 8
"""Bins of each of Lab's axes a and b, each of 8 levels about grey; chosen by hand."""
_PER_BAND = _LIGHTS + _HUES * _HUES
LOOK_LENGTH = len(_BANDS) * _PER_BAND
# Smallest patch that has a descriptor [px]: a quarter of the size to which patches are brought,
# chosen by hand.
_LEAST_WIDTH = 3
_LEAST_HEIGHT = 6

# Exposure changes by more than the lightness of clothes differs: it is blurred over three bins.
# The shares are chosen by hand.
_BLUR = sum(np.eye(_LIGHTS, k=k) * share for k, share in ((-1, 0.3), (0, 0.4), (1, 0.3)))
_ACROSS = (np.arange(_WIDTH) + 0.5) / _WIDTH - 0.5
_ROWS = np.concatenate([np.arange(low, high) for low, high in _BANDS])
_BAND_OF_ROW = np.repeat(np.arange(len(_BANDS)), [high - low for low, high in _BANDS])
# A person is in the middle of the box, with background at both sides. The standard deviation of
# 0.16 box widths is chosen by hand.
_WEIGHT = np.tile(np.exp(-0.5 * (_ACROSS / 0.16) ** 2), len(_ROWS))
_BAND_OFFSET = np.repeat(_BAND_OF_ROW, _WIDTH) * _PER_BAND


def cut_out(image: NDArray[np.uint8], boxes: FloatArray) -> list[Patch]:
    """The pixels of a BGR picture under (N, 4) xyxy boxes, as far as they are in the picture."""
    height, width = image.shape[:2]
    limits = np.array([width, height, width, height])
    corners = np.clip(np.rint(boxes), 0, limits).astype(int).tolist()
    return [image[top:bottom, left:right] for left, top, right, bottom in corners]


def describe(patches: Sequence[Patch]) -> FloatArray:
    """Appearance descriptors of N patches: (N, `LOOK_LENGTH`), rows of unit Euclidean length.

    Square roots of Lab histograms in five bands, weighted towards the patch's upright axis, where
    the person is. Patches of a few pixels give equal entries.
    """
    looks = np.full((len(patches), LOOK_LENGTH), LOOK_LENGTH**-0.5)
    large = [
        k
        for k, patch in enumerate(patches)
        if patch.shape[1] >= _LEAST_WIDTH and patch.shape[0] >= _LEAST_HEIGHT
    ]
    if large:
        looks[large] = _histograms([patches[k] for k in large])
    return looks


def _small(patch: Patch) -> Patch:
    """The patch at the size of a descriptor, from every k-th pixel of a large one.

    The mean over all pixels of a large patch takes longer than all the rest.
    """
    step = max(1, min(patch.shape[0] // (2 * _HEIGHT), patch.shape[1] // (2 * _WIDTH)))
    even = cv2.resize(patch[::step, ::step], (_WIDTH, _HEIGHT), interpolation=cv2.INTER_AREA)
    return np.asarray(even[_ROWS], np.uint8)


def _histograms(patches: list[Patch]) -> FloatArray:
    pixels = np.concatenate([_small(patch) for patch in patches])
    lab = cv2.cvtColor(pixels, cv2.COLOR_BGR2LAB).reshape(-1, 3).astype(np.float64)
    light = np.clip(lab[:, 0] / 32.0 - 0.5, 0, _LIGHTS - 1.001)
    a, b = np.clip((lab[:, 1:].T - 128) / 8.0 + 3.5, 0, _HUES - 1.001)
    count = len(patches)
    first = (np.arange(count)[:, None] * LOOK_LENGTH + _BAND_OFFSET).ravel()
    weight = np.tile(_WEIGHT, count)
    length = count * LOOK_LENGTH
    total = soft_counts(length, first, [(light, _LIGHTS, 1)], weight)
    hues = [(a, _HUES, _HUES), (b, _HUES, 1)]
    total += soft_counts(length, first + _LIGHTS, hues, weight)
    bands = total.reshape(count, len(_BANDS), _PER_BAND)
    bands[:, :, :_LIGHTS] = bands[:, :, :_LIGHTS] @ _BLUR
    looks = bands.reshape(count, LOOK_LENGTH)
    return np.asarray(np.sqrt(looks / looks.sum(axis=1, keepdims=True)))


def distances(first: FloatArray, second: FloatArray) -> FloatArray:
    """Hellinger distances in [0, 1] of (N, D) and (M, D) rows of `describe`, shape (N, M)."""
    return np.asarray(np.sqrt(np.clip(1 - first @ second.T, 0.0, 1.0)))
