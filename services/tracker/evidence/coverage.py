"""Where people of a given height line would stand on the evidence, and how much they explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.lib.stride_tricks import as_strided

from heel.services.geometry.boxes import intersection_matrix
from heel.services.tracker.evidence.arrays import FloatMap, Floats, Foot, box_at, shrunk
from heel.services.tracker.evidence.template import CLUTTER, Template, template

_TEMPLATE_ROWS = 15.0
"""Reduced pixels: height to which people are reduced, enough to place them to within a few working
pixels."""
_BAND = 2
"""Foot rows, reduced pixels, that share one template and one correlation: their heights hardly
differ; chosen by hand for speed."""
_BUSY = 0.3
"""Unexplained evidence, 0 to 1, from which a row or a column is searched: the rest cannot give a
person and costs time; chosen by hand."""
_PER_PIXEL = -float(np.log(CLUTTER))
"""Nats: what one pixel of evidence is worth at most against clutter."""
_OVERLAP = 0.3
"""Share of a candidate's box under one that explains more, above which it is left out: both would
explain the same evidence; chosen by hand."""


class HeightLine(Protocol):
    """The part of a scene scale that is used here."""

    @property
    def ratio(self) -> float:
        """Width by height of a person."""
        ...

    def height(self, foot_row: float) -> float:
        """Height at a foot row, working pixels."""
        ...


@dataclass(frozen=True)
class Standing:
    """A possible person.

    Attributes:
        foot: where, working pixels.
        height: working pixels.
        total: log-likelihood ratio against clutter, summed over reduced pixels.
        gain: total by that of a clean person that stands alone.
    """

    foot: Foot
    height: float
    total: float
    gain: float


def reduction(typical_height: float) -> int:
    """How many times the evidence may be reduced for people of this height."""
    return int(np.clip(round(typical_height / _TEMPLATE_ROWS), 1, 12))


def reduce(rest: FloatMap, absent: FloatMap, step: int) -> FloatMap:
    """Unexplained evidence and absence, (H, W) each, reduced by `step` to (H', W', 2)."""
    return np.asarray(cv2.merge([shrunk(rest, step), shrunk(absent, step)]), np.float32)


def standing(
    reduced: FloatMap, step: int, line: HeightLine, smallest: float, threshold: float
) -> list[Standing]:
    """People that would explain evidence, most explained first, overlapping ones left out.

    Args:
        reduced: (H, W, 2) from `reduce`.
        step: its reduction.
        line: heights.
        smallest: lowest height considered, working pixels.
        threshold: least gain.
    """
    rows = reduced.shape[0]
    busy = np.flatnonzero(reduced[..., 0].max(axis=1) > _BUSY)
    if not busy.size:
        return []
    tallest = int(line.height(rows * step * 1.1) / step * 1.1) + 3
    half = int(tallest * line.ratio) + 2
    padded = _padded(reduced, tallest, half)
    column_busy = padded[..., 0] > _BUSY
    peaks: list[_Peak] = []
    for row in range(int(busy[0]), min(int(rows * 1.12) + 1, int(busy[-1]) + tallest), _BAND):
        height = line.height((row + 0.5) * step) / step
        if height * step < smallest or row - height > busy[-1]:
            continue
        shape = template(height, line.ratio)
        top = row - shape.foot[1] + tallest
        bottom = top + _BAND - 1 + shape.cover.shape[0]
        if top < 0 or bottom > padded.shape[0]:
            continue
        hot = np.flatnonzero(column_busy[top:bottom].any(axis=0))
        if hot.size:
            first = max(int(hot[0]) - shape.foot[0], 0)
            strip = padded[top:bottom, first : int(hot[-1]) + shape.foot[0] + 1]
            found = _peaks_of(strip, shape, threshold)
            peaks += [_Peak(p.total, p.column + first - half, p.row + row, p.gain) for p in found]
    return _without_overlap(peaks, step, line)


def _padded(reduced: FloatMap, above: int, beside: int) -> FloatMap:
    """With room for people partly outside the image."""
    edges = (above, above, beside, beside)
    return np.asarray(cv2.copyMakeBorder(reduced, *edges, cv2.BORDER_CONSTANT, value=0), np.float32)


@dataclass(frozen=True)
class _Peak:
    total: float
    column: int
    row: int
    gain: float


def _peaks_of(strip: FloatMap, shape: Template, threshold: float) -> list[_Peak]:
    """Where the template fits in a band of foot rows; rows and columns from the strip's corner."""
    width = shape.cover.shape[1]
    if strip.shape[1] < width:
        return []
    # Absence only takes away, so that evidence times the largest weight bounds the fit.
    sums = np.cumsum(np.concatenate([[0.0], strip[..., 0].sum(axis=0)]))
    least = threshold * shape.norm
    hot = np.flatnonzero((sums[width:] - sums[:-width]) * shape.highest >= least)
    if not hot.size:
        return []
    first = int(hot[0])
    part = strip[:, first : int(hot[-1]) + width]
    total = _correlated(part, shape.weights)
    best, best_row = total.max(axis=0), total.argmax(axis=0)
    last = len(best) - 1
    return [
        _Peak(
            float(best[i]),
            int(i) + first + shape.foot[0],
            int(best_row[i]),
            float(best[i]) / shape.norm,
        )
        for i in np.flatnonzero(best > least)
        if best[i] >= best[max(i - 1, 0)] and best[i] >= best[min(i + 1, last)]
    ]


def _correlated(strip: FloatMap, weights: FloatMap) -> FloatMap:
    """Correlation where the template lies within the strip; (H, W, 2) and (h, w, 2) float32.

    As one matrix product, of which the diagonals are summed. cv2.matchTemplate goes by way of
    Fourier transforms, which take longer for so narrow a strip.
    """
    height, width = weights.shape[0], 2 * weights.shape[1]
    bands, columns = len(strip) - height + 1, strip.shape[1] - weights.shape[1] + 1
    shifted: FloatMap = np.zeros((bands, width, len(strip)), np.float32)
    for band in range(bands):
        shifted[band, :, band : band + height] = weights.reshape(height, width).T
    product = shifted.reshape(bands * width, -1) @ strip.reshape(len(strip), -1)
    by_band = product.reshape(bands, width, -1)
    band_step, row_step, column_step = by_band.strides
    diagonals = as_strided(
        by_band, (bands, columns, width), (band_step, 2 * column_step, row_step + column_step)
    )
    return np.asarray(diagonals.sum(axis=2), np.float32)


def _without_overlap(peaks: Sequence[_Peak], step: int, line: HeightLine) -> list[Standing]:
    chosen: list[Standing] = []
    boxes: Floats = np.zeros((0, 4))
    for peak in sorted(peaks, key=lambda peak: (-peak.total, peak.column, peak.row)):
        foot = ((peak.column + 0.5) * step - 0.5, (peak.row + 0.5) * step - 0.5)
        height = line.height(foot[1])
        box = np.array(box_at(foot, height, line.ratio))
        common = intersection_matrix(boxes, box[None])
        if (common > _OVERLAP * line.ratio * height * height).any():
            continue
        boxes = np.vstack([boxes, box])
        chosen.append(Standing(foot, height, peak.total, peak.gain))
    return chosen


def explained_share(reduced: FloatMap, step: int, line: HeightLine, smallest: float) -> float:
    """Share of the evidence's log-likelihood that people of this line explain, about [0, 1]."""
    whole = float(reduced[..., 0].sum()) * _PER_PIXEL
    people = standing(reduced, step, line, smallest, 0.3)
    return sum(person.total for person in people) / max(whole, 1e-6)
