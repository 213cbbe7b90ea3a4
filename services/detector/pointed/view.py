"""Part of a picture, brought to the size at which a person is looked at."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.services.detector.pointed.silhouette import FloatMap

PERSON_PX = 56
"""Height of a person in a view, pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
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
) -> View:
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
    return View(view, inside, scale, left, top, image.shape[0])


def scaled_part(
    image: NDArray[np.uint8], left: float, top: float, scale: float, size: tuple[int, int]
) -> NDArray[np.uint8]:
    """So many columns and rows from a corner on, enlarged; beyond the border its pixels go on."""
    # Pixel centres: the affine maps corners of pixels.
    affine = np.array([[scale, 0.0, -scale * left + 0.5 * scale - 0.5],
                       [0.0, scale, -scale * top + 0.5 * scale - 0.5]])  # fmt: skip
    part = cv2.warpAffine(image, affine, size, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(part, np.uint8)
