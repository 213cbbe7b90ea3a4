"""A standing person as a soft silhouette, cut into strips from head to foot."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

FloatMap = NDArray[np.float32]

STRIPS = 6
ASPECT = 0.4
"""Width by height of the box."""
_AROUND = 1.7
"""Width of the template, boxes: what stands out beside the body is no part of it."""
_ABOVE = 0.12
"""Rows above the head and below the feet, heights."""
_EDGE = 0.06
"""Softness of the sides, box widths."""

# Half width of a walking person from head (0) to foot (1), averaged over the steps; box widths.
_REACH_AT = (-0.03, 0.0, 0.04, 0.12, 0.20, 0.35, 0.50, 0.65, 0.80, 0.95, 1.0, 1.03)
_REACH = (-0.2, 0.08, 0.17, 0.20, 0.36, 0.42, 0.40, 0.33, 0.30, 0.32, 0.25, -0.2)


def reach(down: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half width of the body at places from head (0) to foot (1), box widths; below 0: none."""
    return np.asarray(np.interp(down, _REACH_AT, _REACH))


@dataclass(frozen=True, eq=False)
class Strip:
    """One strip of a template.

    Attributes:
        first_row: of the strip in the template.
        weights: (h, W) float32: positive inside the body, negative beside it.
    """

    first_row: int
    weights: FloatMap


@dataclass(frozen=True, eq=False)
class Silhouette:
    """Template of one height.

    Attributes:
        strips: from head to foot; the first has what is above the head, the last what is below
            the feet.
        cover: (H, W) float32 in [0, 1], the body.
        centre: column and row of the box's centre.
    """

    strips: tuple[Strip, ...]
    cover: FloatMap
    centre: tuple[int, int]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return (self.cover.shape[0], self.cover.shape[1])


@dataclass(frozen=True, slots=True)
class Place:
    """Where the template of a height lies: its first row and column, pixels."""

    row: int
    column: int
    height: int

    @property
    def middle(self) -> tuple[float, float]:
        """Column and row of the middle of the box."""
        column, row = silhouette(self.height).centre
        return float(self.column + column), float(self.row + row)

    @property
    def span(self) -> tuple[slice, slice]:
        """Rows and columns of the template."""
        high, wide = silhouette(self.height).shape
        return slice(self.row, self.row + high), slice(self.column, self.column + wide)


@lru_cache(maxsize=256)
def silhouette(height_px: int) -> Silhouette:
    """Of somebody so high, at least 8 px. Weights inside sum to 1, those beside to -1."""
    width = ASPECT * height_px
    half = max(2, round(0.5 * _AROUND * width))
    above = max(1, round(_ABOVE * height_px))
    row = (np.arange(-above, height_px + above) + 0.5) / height_px
    column = np.abs(np.arange(-half, half + 1)) / width
    cover = 1.0 / (1.0 + np.exp((column[None, :] - reach(row)[:, None]) / _EDGE))
    beside = 1.0 - cover
    weights = (cover / cover.sum() - beside / beside.sum()).astype(np.float32)
    edges = np.rint(above + height_px * np.arange(STRIPS + 1) / STRIPS).astype(int).tolist()
    edges[0], edges[-1] = 0, len(row)
    strips = tuple(
        Strip(first, np.ascontiguousarray(weights[first:last])) for first, last in pairwise(edges)
    )
    return Silhouette(strips, cover.astype(np.float32), (half, above + height_px // 2))
