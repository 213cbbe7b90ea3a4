"""Lenses that bend straight lines: from pixels to rays and back.

Brown's model (D. C. Brown, "Close-range camera calibration", Photogrammetric Engineering 37(8),
1971) and the fisheye model of Kannala & Brandt (IEEE T-PAMI 28(8), 2006), both as OpenCV and ROS
write them. All that Heel computes of places goes by rays, so that a lens is known here alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from heel.schemas.frame import LensModel

FloatArray = NDArray[np.float64]
_WIDEST = math.tan(math.radians(85))
"""Largest distance of a ray from the axis, 1 deep: rays beyond it, of a fisheye's rim, are taken
for rays at 85 degrees; no person is followed by them. Chosen by hand."""
_RETURN_PX = 1.0
"""Pixels by which going to a ray and back may be wrong: below what a box's edge is; chosen by
hand."""
_ROUNDS = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-10)
"""The inverse of Brown's model is iterated: 5 rounds, OpenCV's default, leave 3 degrees at the rim
of a lens of 120 degrees."""


@dataclass(frozen=True, slots=True)
class Lens:
    """One lens with a picture size.

    Attributes:
        fisheye: the fisheye model; Brown's otherwise.
        focal_px, centre_px: (x, y) of the picture.
        coefficients: k1 to k4 of a fisheye, else OpenCV's k1 k2 p1 p2 k3 k4 k5 k6.
    """

    fisheye: bool
    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    coefficients: tuple[float, ...] = ()

    @classmethod
    def told(cls, model: LensModel) -> Lens:
        """As a camera says of itself."""
        fisheye = model.model == "equidistant"
        return cls(fisheye, model.focal_px, model.centre_px, model.coefficients)

    def model(self) -> LensModel:
        """As a camera says it."""
        return LensModel(
            model="equidistant" if self.fisheye else "plumb_bob", focal_px=self.focal_px,
            centre_px=self.centre_px, coefficients=self.coefficients,
        )  # fmt: skip

    def scaled(self, across: float, down: float) -> Lens:
        """Of the same picture at another size; factors of its width and height, above 0."""
        (focal_x, focal_y), (x, y) = self.focal_px, self.centre_px
        focal_px, centre_px = (focal_x * across, focal_y * down), (x * across, y * down)
        return Lens(self.fisheye, focal_px, centre_px, self.coefficients)

    def rays(self, pixels: ArrayLike) -> FloatArray:
        """(..., 2) pixels to rays (..., 2): to the right and down, 1 deep along the axis."""
        points = np.asarray(pixels, np.float64)
        flat = np.ascontiguousarray(points.reshape(-1, 1, 2))
        if self.fisheye:
            found = cv2.fisheye.undistortPoints(flat, self._matrix(), self._distortion())
        else:
            # OpenCV 4 takes the rounds by another name.
            iterate = getattr(cv2, "undistortPointsIter", None)
            matrix, distortion, still = self._matrix(), self._distortion(), np.eye(3)
            if iterate is not None:
                found = iterate(flat, matrix, distortion, still, still, _ROUNDS)
            else:
                found = cv2.undistortPoints(flat, matrix, distortion, criteria=_ROUNDS)
        rays = np.asarray(found, np.float64).reshape(-1, 2)
        off = np.hypot(*rays.T)
        beyond = ~(off <= _WIDEST)
        if beyond.any():
            outward = (flat[beyond, 0] - self.centre_px) / self.focal_px
            rays[beyond] = _WIDEST * outward / np.maximum(np.hypot(*outward.T), 1e-9)[:, None]
        return rays.reshape(points.shape)

    def pixels(self, rays: ArrayLike) -> FloatArray:
        """The inverse of `rays`: (..., 2) to pixels (..., 2); NaN stays NaN."""
        points = np.asarray(rays, np.float64)
        flat = points.reshape(-1, 1, 2)
        if self.fisheye:
            seen = cv2.fisheye.distortPoints(flat, self._matrix(), self._distortion())
        else:
            deep = np.concatenate([flat, np.ones_like(flat[..., :1])], axis=-1)
            still = np.zeros(3)
            seen = cv2.projectPoints(deep, still, still, self._matrix(), self._distortion())[0]
        return np.asarray(seen, np.float64).reshape(points.shape)

    def covers(self, width_px: int, height_px: int) -> bool:
        """Whether the model holds as far as the picture's rim.

        Brown's polynomial need not grow as far: from there on two rays have one pixel.
        """
        across, down = np.linspace(0, width_px, 17), np.linspace(0, height_px, 13)
        sides = [np.stack([across, np.full(17, row)], axis=1) for row in (0.0, height_px)]
        sides += [np.stack([np.full(13, column), down], axis=1) for column in (0.0, width_px)]
        rim = np.concatenate(sides)
        rays = self.rays(rim)
        told = np.hypot(*rays.T) < 0.999 * _WIDEST
        back = self.pixels(rays[:, None] * np.linspace(0, 1, 33)[:, None])
        grows = np.diff(np.hypot(*np.moveaxis(back - self.centre_px, -1, 0)), axis=1) > 0
        returns = np.hypot(*(back[:, -1] - rim).T) < _RETURN_PX
        return bool((grows.all(axis=1) & returns)[told].all())

    def _matrix(self) -> FloatArray:
        (focal_x, focal_y), (x, y) = self.focal_px, self.centre_px
        return np.array([[focal_x, 0.0, x], [0.0, focal_y, y], [0.0, 0.0, 1.0]])

    def _distortion(self) -> FloatArray:
        wanted = 4 if self.fisheye else 8
        return np.array([*self.coefficients, *[0.0] * wanted][:wanted])
