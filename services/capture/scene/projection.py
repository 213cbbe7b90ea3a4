"""The drawn scene's camera: from metres on a flat ground to pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


@dataclass(frozen=True)
class GroundCamera:
    """A level pinhole camera with its optical axis shifted up, as in an architect's picture.

    World: X to the right, Z away from the camera, U up, metres, origin on the ground below it.
    All proportions hold for every frame size; they are those of 640x480.
    """

    width: int
    height: int
    mount_height_m: float = 3.2

    @property
    def focal_px(self) -> float:
        """Focal length in pixels."""
        return self.height * 560 / 480

    @property
    def horizon_px(self) -> float:
        """Row of the horizon."""
        return self.height * 110 / 480

    def project(self, points: Points) -> Points:
        """(..., 3) X, Z, U in metres to (..., 2) pixels."""
        scale = self.focal_px / points[..., 1]
        pixels = np.empty((*points.shape[:-1], 2))
        pixels[..., 0] = self.width / 2 + scale * points[..., 0]
        pixels[..., 1] = self.horizon_px + scale * (self.mount_height_m - points[..., 2])
        return pixels

    def half_width_m(self, z_m: float) -> float:
        """Half the width of ground in view at distance `z_m`."""
        return z_m * self.width / 2 / self.focal_px

    def row_distance_m(self, rows_px: Points) -> Points:
        """Distance of the ground at image rows below the horizon."""
        return self.focal_px * self.mount_height_m / np.maximum(rows_px - self.horizon_px, 1e-3)
