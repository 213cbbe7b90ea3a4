"""About where the person at a point ends: where colours differ most inside and outside.

Upright bodies of every size about the point are tried: those are people whose strips from head to
foot differ from what is beside them, above the head and below the feet. Histograms of rectangles
come from integral images (F. Porikli, "Integral histogram", CVPR 2005).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy
from heel.services.detector.pointed.silhouette import ASPECT, reach

_ROWS = 180
"""Pictures are looked at at about this height, pixels."""
_LIGHT_STEP, _HUE_STEP = 24, 8
_MOST_COLOURS = 128
"""The most frequent ones; all others count as one."""
_STRIPS = 8
_LOWEST, _HIGHEST, _STEP = 0.2, 1.25, 1.07
"""Heights tried, picture heights."""
_DOWN = (0.15, 0.72, 0.03)
"""Where the point lies on the body, from head to foot: from, to, step."""
_ASIDE, _ASIDE_STEP = 0.1, 0.025
"""And how far from its middle, heights."""
_HORIZON = (0.38, 0.75)
"""Part of the body at which the middle row lies: a robot's level camera is no higher than they."""
_GAP, _BESIDE = 0.06, 0.12
_END_WEIGHT, _LONGER = 0.5, 0.3
"""Of the contrast at head and feet, and of ln(height): a body without its legs stands out, too."""
_UNTOLD = 0.4
"""Contrast taken for ends that are out of the picture."""
_LEAST_SIDES = 0.45
"""Persons reach 0.69 on 112 rendered pictures."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Bodies:
    """Candidates, (N,) each, pixels: middle, head, height."""

    x: Floats
    top: Floats
    height: Floats


@dataclass(frozen=True, slots=True)
class Contrast:
    """An upright body that differs from what is around it.

    Attributes:
        box_xyxy: off by up to a seventh of its height, pixels.
        sides: mean difference from what is on either side, in [0, 1].
        ends: sum of those above the head and below the feet, in [0, 2].
    """

    box_xyxy: BoxXyxy
    sides: float
    ends: float


def most_contrast(image: NDArray[np.uint8], x_px: float, y_px: float) -> Contrast | None:
    """The body at a point that differs most from what is around it; None: nobody's shape.

    Args:
        image: (H, W, 3) uint8 BGR.
        x_px, y_px: a point on their body, better on the chest than on the feet.
    """
    scale = min(1.0, _ROWS / image.shape[0])
    size = max(1, round(scale * image.shape[1])), max(1, round(scale * image.shape[0]))
    small = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    bodies = _candidates(size[1], scale * x_px, scale * y_px)
    if not len(bodies.x):
        return None
    counts = _ColourCounts(small)
    sides = _side_contrast(counts, bodies)
    ends = _end_contrast(counts, bodies)
    total = sides + _END_WEIGHT * ends
    best = int(np.argmax(total + _LONGER * np.log(bodies.height / size[1])))
    if sides[best] < _LEAST_SIDES:
        return None
    x, top, height = (float(of[best]) / scale for of in (bodies.x, bodies.top, bodies.height))
    half = 0.5 * ASPECT * height
    box = (x - half, top, x + half, top + height)
    return Contrast(box, float(sides[best]), float(ends[best]))


def _candidates(rows: int, x: float, y: float) -> _Bodies:
    count = int(np.log(_HIGHEST / _LOWEST) / np.log(_STEP)) + 1
    heights = rows * _LOWEST * _STEP ** np.arange(count)
    asides = np.arange(-_ASIDE, _ASIDE + 1e-6, _ASIDE_STEP)
    height, down, aside = (
        grid.ravel() for grid in np.meshgrid(heights, np.arange(*_DOWN), asides, indexing="ij")
    )
    top = y - down * height
    horizon = (0.5 * rows - top) / height
    level = (horizon > _HORIZON[0]) & (horizon < _HORIZON[1])
    return _Bodies(x + aside[level] * height[level], top[level], height[level])


def _side_contrast(counts: _ColourCounts, of: _Bodies) -> Floats:
    """Mean difference between strips of the body and what is on either side of them."""
    total, told = np.zeros(len(of.x)), np.zeros(len(of.x))
    width = ASPECT * of.height
    for strip in range(_STRIPS):
        first, last = strip / _STRIPS, (strip + 1) / _STRIPS
        half = reach(np.linspace(first, last, 5)).mean() * width
        top, bottom = of.top + first * of.height, of.top + last * of.height
        body = counts.within(top, of.x - 0.85 * half, bottom, of.x + 0.85 * half)
        near, far = half + _GAP * of.height, half + (_GAP + _BESIDE) * of.height
        for left, right in ((of.x - far, of.x - near), (of.x + near, of.x + far)):
            differs, known = _difference(body, counts.within(top, left, bottom, right))
            total += np.where(known, differs, 0.0)
            told += known
    return total / np.maximum(told, 1.0)


def _end_contrast(counts: _ColourCounts, of: _Bodies) -> Floats:
    """Sum of the differences between head and what is above it, and legs and the floor below."""
    height, top, x = of.height, of.top, of.x
    head = counts.within(top + 0.01 * height, x - 0.06 * height,
                         top + 0.10 * height, x + 0.06 * height)  # fmt: skip
    above = counts.within(top - 0.10 * height, x - 0.06 * height,
                          top - 0.02 * height, x + 0.06 * height)  # fmt: skip
    legs = counts.within(top + 0.875 * height, x - 0.1 * height, top + height, x + 0.1 * height)
    below = counts.within(top + 1.03 * height, x - 0.1 * height,
                          top + 1.10 * height, x + 0.1 * height)  # fmt: skip
    ends = (_difference(head, above), _difference(legs, below))
    return np.asarray(sum(np.where(known, differs, _UNTOLD) for differs, known in ends))


def _difference(a: Floats, b: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """(N,) total variation between histograms (N, K) of counts, and where both have pixels."""
    of_a, of_b = a.sum(axis=1), b.sum(axis=1)
    known = (of_a > 3.0) & (of_b > 3.0)
    shares = a / np.maximum(of_a, 1.0)[:, None] - b / np.maximum(of_b, 1.0)[:, None]
    return 0.5 * np.abs(shares).sum(axis=1), known


class _ColourCounts:
    """Histograms of rectangles of one picture."""

    def __init__(self, image: NDArray[np.uint8]) -> None:
        lab = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2LAB), np.int32)
        hues = (lab[..., 1:] - 128) // _HUE_STEP + 64
        code = (lab[..., 0] // _LIGHT_STEP) << 16 | hues[..., 0] << 8 | hues[..., 1]
        _, colours, counts = np.unique(code, return_inverse=True, return_counts=True)
        rank = np.empty(len(counts), np.int32)
        rank[np.argsort(-counts, kind="stable")] = np.arange(len(counts))
        colours = np.minimum(rank, _MOST_COLOURS - 1)[colours].reshape(code.shape)
        layers = [
            cv2.integral((colours == colour).astype(np.uint8), sdepth=cv2.CV_32F)
            for colour in range(int(colours.max()) + 1)
        ]
        self._sums = np.ascontiguousarray(np.stack(layers, axis=-1))

    def within(self, top: Floats, left: Floats, bottom: Floats, right: Floats) -> Floats:
        """(N, K) pixels of each colour in rectangles, (N,) pixels each."""
        rows, columns = (side - 1 for side in self._sums.shape[:2])
        first_row, last_row = _clipped(top, rows), _clipped(bottom, rows)
        first, last = _clipped(left, columns), _clipped(right, columns)
        sums = self._sums
        counts = sums[last_row, last] - sums[first_row, last]
        counts += sums[first_row, first] - sums[last_row, first]
        return np.asarray(counts, np.float64)


def _clipped(at: Floats, most: int) -> NDArray[np.intp]:
    return np.clip(np.rint(at), 0, most).astype(np.intp)
