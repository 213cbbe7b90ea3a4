"""Appearance descriptors of people: colours of five bands of the body, all people at once.

One colour histogram per body band. Histograms are soft: a pixel is shared between neighbouring
bins, so that a slight change of light moves a descriptor only slightly. A foreground mask, where
there is one, takes the background off.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.services.geometry.histograms import soft_counts

FloatArray = NDArray[np.float64]
Patch = NDArray[np.uint8]
"""(H, W, 3) uint8 BGR pixels under a box."""
Mask = NDArray[np.uint8] | NDArray[np.float32] | NDArray[np.bool_]
"""(h, w) of any size, for the same box as a patch: 0 background, 1 person."""
_Pixel = TypeVar("_Pixel", bound=np.generic)

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
DESCRIPTOR_LENGTH = len(_BANDS) * _PER_BAND
# Smallest patch that has a descriptor [px]: a quarter of the size to which patches are brought,
# chosen by hand.
_LEAST_WIDTH = 3
_LEAST_HEIGHT = 6
_LEAST_SEEN = 0.25
"""Foreground's share of a band's weight below which the band counts less, as a few pixels are
noise; chosen by hand."""
_LEAST_FOREGROUND = 0.1
"""Share of the whole weight below which a mask is not of the person, and left out; chosen by
hand."""
_BACKGROUND = 0.1
"""Weight of a pixel outside the mask: masks have holes where a person is of the background's
colour. Chosen by hand."""

# Exposure changes by more than the lightness of clothes differs: it is blurred over three bins.
# The shares are chosen by hand.
_BLUR = sum(np.eye(_LIGHTS, k=k) * share for k, share in ((-1, 0.3), (0, 0.4), (1, 0.3)))
_ACROSS = (np.arange(_WIDTH) + 0.5) / _WIDTH - 0.5
_ROWS = np.concatenate([np.arange(low, high) for low, high in _BANDS])
_BAND_OF_ROW = np.repeat(np.arange(len(_BANDS)), [high - low for low, high in _BANDS])
_MIDDLE = np.tile(np.exp(-0.5 * (_ACROSS / 0.16) ** 2), (len(_ROWS), 1))
"""Weights of pixels without a mask: the person is in the middle of the box, with background at both
sides. The standard deviation of 0.16 box widths is chosen by hand."""
_AROUND = np.tile(np.exp(-0.5 * (_ACROSS / 0.2) ** 2), (len(_ROWS), 1))
"""The same with a mask: the middle's surroundings count as well. 0.2 box widths: chosen by hand."""
_BAND_OFFSET = np.repeat(_BAND_OF_ROW, _WIDTH) * _PER_BAND
_BAND_STARTS = np.cumsum([0, *(high - low for low, high in _BANDS[:-1])])
"""Row, of those in `_ROWS`, at which each band begins."""


def cut_out(image: NDArray[_Pixel], boxes: FloatArray) -> list[NDArray[_Pixel]]:
    """The pixels of a picture or mask under (N, 4) xyxy boxes, as far as they are in it."""
    height, width = image.shape[:2]
    limits = np.array([width, height, width, height])
    corners = np.clip(np.rint(boxes), 0, limits).astype(int).tolist()
    return [image[top:bottom, left:right] for left, top, right, bottom in corners]


def describe(patches: Sequence[Patch], masks: Sequence[Mask] | None = None) -> FloatArray:
    """Appearance descriptors of N patches: (N, `DESCRIPTOR_LENGTH`), rows of unit length.

    Square roots of Lab histograms in five bands, weighted towards the patch's upright axis, where
    the person is. Patches of a few pixels give equal entries.

    Args:
        patches: BGR pixels under boxes.
        masks: of each which of its pixels are the person; without them the middle is. One that
            shows next to nothing counts as none.
    """
    found = np.full((len(patches), DESCRIPTOR_LENGTH), DESCRIPTOR_LENGTH**-0.5)
    large = [
        k
        for k, patch in enumerate(patches)
        if patch.shape[1] >= _LEAST_WIDTH and patch.shape[0] >= _LEAST_HEIGHT
    ]
    if large:
        shown = None if masks is None else [masks[k] for k in large]
        found[large] = _histograms([patches[k] for k in large], shown)
    return found


def _small(pixels: NDArray[Any]) -> NDArray[Any]:
    """Pixels at the size of a descriptor, from every k-th one of a large patch.

    The mean over all pixels of a large patch takes longer than all the rest.
    """
    step = max(1, min(pixels.shape[0] // (2 * _HEIGHT), pixels.shape[1] // (2 * _WIDTH)))
    even = cv2.resize(pixels[::step, ::step], (_WIDTH, _HEIGHT), interpolation=cv2.INTER_AREA)
    return np.asarray(even[_ROWS])


def _weights(masks: Sequence[Mask]) -> FloatArray:
    """Of each patch's pixels, (N, rows, columns)."""
    weights = np.tile(_MIDDLE, (len(masks), 1, 1))
    for weight, mask in zip(weights, masks, strict=True):
        if mask.size:
            person = _small(np.asarray(mask, np.float32))
            if (_AROUND * person).sum() >= _LEAST_FOREGROUND * _AROUND.sum():
                weight[:] = _AROUND * (_BACKGROUND + (1 - _BACKGROUND) * person)
    return weights


def _histograms(patches: list[Patch], masks: list[Mask] | None) -> FloatArray:
    count = len(patches)
    pixels = np.concatenate([_small(patch) for patch in patches])
    lab = cv2.cvtColor(pixels, cv2.COLOR_BGR2LAB).reshape(-1, 3).astype(np.float64)
    light = np.clip(lab[:, 0] / 32.0 - 0.5, 0, _LIGHTS - 1.001)
    a, b = np.clip((lab[:, 1:].T - 128) / 8.0 + 3.5, 0, _HUES - 1.001)
    first = (np.arange(count)[:, None] * DESCRIPTOR_LENGTH + _BAND_OFFSET).ravel()
    weights = np.tile(_MIDDLE, (count, 1, 1)) if masks is None else _weights(masks)
    length = count * DESCRIPTOR_LENGTH
    total = soft_counts(length, first, [(light, _LIGHTS, 1)], weights.ravel())
    hues = [(a, _HUES, _HUES), (b, _HUES, 1)]
    total += soft_counts(length, first + _LIGHTS, hues, weights.ravel())
    bands = total.reshape(count, len(_BANDS), _PER_BAND)
    bands[:, :, :_LIGHTS] = bands[:, :, :_LIGHTS] @ _BLUR
    if masks is not None:
        # Every band counts by its rows, however much of it the mask leaves, down to a few pixels.
        seen = np.add.reduceat(weights.sum(axis=2), _BAND_STARTS, axis=1)
        usual = np.add.reduceat(_AROUND.sum(axis=1), _BAND_STARTS)
        bands *= (usual / np.maximum(seen, _LEAST_SEEN * usual))[:, :, None]
    found = bands.reshape(count, DESCRIPTOR_LENGTH)
    return np.asarray(np.sqrt(found / found.sum(axis=1, keepdims=True)))


def distances(first: FloatArray, second: FloatArray) -> FloatArray:
    """Hellinger distances in [0, 1] of (N, D) and (M, D) rows of `describe`, shape (N, M)."""
    return np.asarray(np.sqrt(np.clip(1 - first @ second.T, 0.0, 1.0)))
