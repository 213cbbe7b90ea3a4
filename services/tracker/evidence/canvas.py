"""The evidence of one frame, and how much of it the people placed so far explain."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from heel.services.tracker.evidence.arrays import FloatMap, Floats, Foot, shrunk
from heel.services.tracker.evidence.template import CLUTTER, Template, template

_LOG_CLUTTER = float(np.log(CLUTTER))
_MARGIN_HEIGHTS = 0.8
"""Share of the tallest person's height by which the canvas reaches beyond the image, so that people
may be partly outside; chosen by hand."""
_MARGIN_PX = 8
"""Reduced pixels that the canvas reaches beyond that, room for the window of a search; chosen by
hand."""


@dataclass(frozen=True)
class Fit:
    """Best position found for a template.

    Attributes:
        foot: where.
        gain: near 1 for a clean person that stands alone, near 0 for nothing that others do not
            explain.
        total: gain not normalised by size.
    """

    foot: Foot
    gain: float
    total: float


@dataclass(frozen=True)
class Window:
    """Where and how a template may move.

    Attributes:
        centre: predicted foot point.
        reach: half size of the window in x and y, working pixels.
        deviation: standard deviation of the prediction, working pixels.
        penalty: gain that one squared deviation costs.
    """

    centre: Foot
    reach: tuple[int, int]
    deviation: float = 1.0
    penalty: float = 0.0


@dataclass(frozen=True, eq=False)
class Crop:
    """What a template of at most this size sees of the canvas within a window.

    Attributes:
        seen: (H, W, 2) float32: unexplained evidence and its absence.
        foot: column and row of the foot point in the template.
    """

    seen: FloatMap
    foot: tuple[int, int]


class Canvas:
    """Evidence with a margin, and the log-probability that each pixel is left unexplained.

    One canvas serves many frames: fresh memory costs more than the arithmetic on it.
    """

    def __init__(self, size: tuple[int, int], tallest: float, step: int, ratio: float) -> None:
        """Make room.

        Args:
            size: rows and columns of the evidence at working size.
            tallest: highest person that may be asked for, working pixels.
            step: the maps are reduced by this factor; feet and heights stay working pixels.
            ratio: width by height of a person.
        """
        self.rows, self.columns = size
        self.tallest = tallest
        self.step = step
        self.ratio = ratio
        margin = self.margin = int(_MARGIN_HEIGHTS * tallest / step) + _MARGIN_PX
        self.inner = (slice(margin, -margin), slice(margin, -margin))
        reduced = max(self.columns // step, 1), max(self.rows // step, 1)
        shape = (reduced[1] + 2 * margin, reduced[0] + 2 * margin)
        # Outside the image nothing is known: no evidence for and none against.
        self.known: FloatMap = np.zeros(shape, np.float32)
        self.known[self.inner] = 1.0
        self.evidence: FloatMap = np.zeros(shape, np.float32)
        self.absent: FloatMap = np.zeros(shape, np.float32)
        self.log_free: FloatMap = np.zeros(shape, np.float32)
        self._nearer: FloatMap = np.zeros(shape, np.float32)

    def load(self, evidence: FloatMap) -> None:
        """Start a frame without people; `evidence` is (H, W) in [0, 1] at working size."""
        self.evidence[self.inner] = shrunk(evidence, self.step)
        np.subtract(self.known, self.evidence, out=self.absent)
        self.log_free.fill(0.0)
        self._nearer.fill(0.0)

    def template(self, height: float) -> Template:
        """Silhouette of a person `height` working pixels high, in reduced pixels."""
        return template(height / self.step, self.ratio)

    def add(self, shape: Template, foot: Foot, sign: float = 1.0) -> None:
        """Place a person (sign 1) or take the person out again (sign -1)."""
        rows, columns, own_rows, own_columns = self._clip(shape, foot)
        self.log_free[rows, columns] += sign * shape.weights[own_rows, own_columns, 1]

    def unexplained(self, rows: slice, columns: slice) -> FloatMap:
        """How unexplained a foreground pixel still is there, [0, 1]."""
        free = (1.0 - CLUTTER) * np.exp(np.minimum(self.log_free[rows, columns], 0.0))
        return np.asarray(np.log(np.maximum(1.0 - free, CLUTTER)) / _LOG_CLUTTER, np.float32)

    def visibility(self, shape: Template, foot: Foot) -> tuple[float, float]:
        """Mean of the evidence under the silhouette, and the share of it inside the image."""
        rows, columns, own_rows, own_columns = self._clip(shape, foot)
        known = shape.cover[own_rows, own_columns] * self.known[rows, columns]
        inside = float(known.sum())
        seen = float((known * self.evidence[rows, columns]).sum())
        return seen / max(inside, 1e-6), inside / shape.mass

    def in_view(self, shape: Template, foot: Foot) -> float:
        """Share of the silhouette left free by those asked about before; hides what is behind."""
        rows, columns, own_rows, own_columns = self._clip(shape, foot)
        cover = shape.cover[own_rows, own_columns]
        nearer = self._nearer[rows, columns]
        seen = float((cover * np.exp(nearer)).sum())
        nearer += shape.weights[own_rows, own_columns, 1]
        return seen / max(float(cover.sum()), 1e-6)

    def crop(self, shape: Template, window: Window) -> Crop | None:
        """What `shape` and smaller ones see in a window; None when it leaves the canvas."""
        column, row = self._corner(shape, window.centre)
        wide, high = self._reach(window)
        height, width = shape.cover.shape
        left, right = column - wide, column + wide + width
        top, bottom = row - high, row + high + height
        if left < 0 or top < 0 or bottom > self.evidence.shape[0] or right > self.evidence.shape[1]:
            return None
        rows, columns = slice(top, bottom), slice(left, right)
        rest = self.evidence[rows, columns] * self.unexplained(rows, columns)
        seen = cv2.merge([rest, self.absent[rows, columns]])
        return Crop(np.asarray(seen, np.float32), shape.foot)

    def search(self, shape: Template, window: Window, crop: Crop | None = None) -> Fit | None:
        """Best foot position in a window; None when the window leaves the canvas.

        Args:
            shape: the template.
            window: where it may move.
            crop: of a template at least as large in the same window, if there is one.
        """
        crop = crop or self.crop(shape, window)
        if crop is None:
            return None
        wide, high = self._reach(window)
        height, width = shape.cover.shape
        left, top = crop.foot[0] - shape.foot[0], crop.foot[1] - shape.foot[1]
        seen = crop.seen[top : top + height + 2 * high, left : left + width + 2 * wide]
        total = np.asarray(cv2.matchTemplate(seen, shape.weights, cv2.TM_CCORR), np.float32)
        return self._best(total, total / shape.norm, window, (wide, high))

    def _reach(self, window: Window) -> tuple[int, int]:
        wide, high = (max(1, math.ceil(reach / self.step)) for reach in window.reach)
        return wide, high

    def _best(self, total: FloatMap, gain: FloatMap, window: Window, reach: tuple[int, int]) -> Fit:
        u, v = self._reduced(window.centre)
        dx: Floats = np.arange(-reach[0], reach[0] + 1, dtype=np.float64) + (round(u) - u)
        dy: Floats = np.arange(-reach[1], reach[1] + 1, dtype=np.float64) + (round(v) - v)
        away = np.add.outer(dy**2, dx**2)
        cost = window.penalty * away * (self.step / window.deviation) ** 2
        score = gain - cost.astype(np.float32)
        i, j = cv2.minMaxLoc(score)[3]
        foot = (
            float(window.centre[0] + (dx[i] + _peak(score[j, :], i)) * self.step),
            float(window.centre[1] + (dy[j] + _peak(score[:, i], j)) * self.step),
        )
        return Fit(foot, float(gain[j, i]), float(total[j, i]))

    def _reduced(self, foot: Foot) -> Foot:
        shift = 0.5 / self.step - 0.5
        return foot[0] / self.step + shift, foot[1] / self.step + shift

    def _corner(self, shape: Template, foot: Foot) -> tuple[int, int]:
        u, v = self._reduced(foot)
        return round(u) - shape.foot[0] + self.margin, round(v) - shape.foot[1] + self.margin

    def _clip(self, shape: Template, foot: Foot) -> tuple[slice, slice, slice, slice]:
        """Rows and columns of the canvas and of the template where they overlap."""
        column, row = self._corner(shape, foot)
        height, width = shape.cover.shape
        top, left = max(row, 0), max(column, 0)
        bottom = max(min(row + height, self.evidence.shape[0]), top)
        right = max(min(column + width, self.evidence.shape[1]), left)
        return (
            slice(top, bottom),
            slice(left, right),
            slice(top - row, bottom - row),
            slice(left - column, right - column),
        )


def _peak(values: FloatMap, index: int) -> float:
    """Sub-pixel offset of a maximum by a parabola through its neighbours."""
    if index == 0 or index == len(values) - 1:
        return 0.0
    before, here, after = (float(value) for value in values[index - 1 : index + 2])
    curve = before - 2.0 * here + after
    return 0.0 if curve >= -1e-9 else max(-0.5, min(0.5, 0.5 * (before - after) / curve))
