"""A standing person as a soft silhouette, in strips from head to foot, and views to lay it on."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.services.geometry.silhouette import LEGS_TOGETHER, Outline

FloatMap = NDArray[np.float32]

STRIPS = 6
"""From head to foot; chosen by hand."""
ASPECT = 0.4
"""Width by height of the box."""
PERSON_PX = 56
"""Height of a person in a view, pixels."""
_AROUND = 1.7  # width of the template, boxes: what stands out beside the body is no part of it
_ABOVE = 0.12  # rows above the head and below the feet, heights
_EDGE = 0.06  # softness of the sides, box widths

_OUTLINE = Outline(LEGS_TOGETHER, beyond=0.03, outside=-0.2)
"""Ends chosen by hand, so that the soft sides leave nothing above the head and below the feet."""


def reach(down: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half width of the body at places from head (0) to foot (1), box widths; below 0: none."""
    return _OUTLINE.half_width(down)


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
    """Of a person so high, at least 8 px. Weights inside sum to 1, those beside to -1."""
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


@dataclass(frozen=True, slots=True, eq=False)
class PersonView:
    """What is around a place in a picture.

    Attributes:
        image: (H, W, 3) uint8 BGR.
        inside: (H, W) float32, 1 where it shows the picture, 0 beyond its border.
        scale: view pixels per picture pixel.
        left, top: of its corner in the picture, picture pixels.
        picture_rows: height of the picture.
    """

    image: NDArray[np.uint8]
    inside: FloatMap
    scale: float
    left: float
    top: float
    picture_rows: int

    def to_picture(self, column: float, row: float) -> tuple[float, float]:
        """x and y in the picture."""
        return self.left + column / self.scale, self.top + row / self.scale


def view_around(
    image: NDArray[np.uint8], x: float, y: float, person_height: float, size: tuple[int, int]
) -> PersonView:
    """The view of so many columns and rows about a point, for people of that height, pixels."""
    scale = PERSON_PX / person_height
    columns, rows = size
    left, top = x - 0.5 * columns / scale, y - 0.5 * rows / scale
    view = scaled_part(image, left, top, scale, size)
    inside = np.zeros((rows, columns), np.float32)
    first_row, first = max(0, round(-scale * top)), max(0, round(-scale * left))
    last_row = min(rows, round(scale * (image.shape[0] - top)))
    last = min(columns, round(scale * (image.shape[1] - left)))
    inside[first_row : max(first_row, last_row), first : max(first, last)] = 1.0
    return PersonView(view, inside, scale, left, top, image.shape[0])


def scaled_part(
    image: NDArray[np.uint8], left: float, top: float, scale: float, size: tuple[int, int]
) -> NDArray[np.uint8]:
    """So many columns and rows from a corner on, enlarged; beyond the border its pixels go on."""
    # Pixel centres: the affine maps corners of pixels.
    affine = np.array([[scale, 0.0, -scale * left + 0.5 * scale - 0.5],
                       [0.0, scale, -scale * top + 0.5 * scale - 0.5]])  # fmt: skip
    part = cv2.warpAffine(image, affine, size, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(part, np.uint8)
