"""What a stereo depth camera makes of true distances: errors that grow with the square, and holes.

The model is that of stereo: what is measured is a disparity in pixels, its error is the same near
and far, and the distance is its reciprocal. Beside things nothing is seen that only one of the two
lenses sees; at edges, on dark patches and beyond its range nothing is measured.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.services.simulator.state import CameraMount

Metres = NDArray[np.float32]

_BASE_M = 0.05
"""Between the two lenses: those of the usual cameras of this kind are 5 to 7.5 cm apart."""
_DISPARITY_SIGMA_PX = 0.08
"""Error of a disparity, pixels of the camera's own pictures, which are as wide as those that the
simulator shows: what makers state for a textured surface. At 4 m and 320 px it is 8 cm."""
_STEPS_PER_PX = 32.0
"""Disparities are told in such parts of a pixel."""
_PATCH_PX = 6
"""Errors are alike over patches of so many depth pixels: those of a window that is matched."""
_SCALE_SIGMA = 0.01
"""Error of a camera's calibration, the same in every picture, share of the distance."""
_NEAREST_M = 0.3
"""Nearer the two pictures are too different to be matched."""
_FARTHEST_M = 9.0
"""Farther nothing is told; makers name 6 to 10 m."""
_EDGE_SHARE = 0.06
"""A step in distance by this share is an edge."""
_EDGE_HOLES = 0.6
"""Share of the pixels at edges that are holes; chosen by hand."""
_STRAY_SHARE = 0.15
"""Share of those that have a distance between both sides instead; chosen by hand."""
_DARK_SHARE_SIGMAS = 2.0
"""Patches whose noise is beyond so many deviations are holes: 2 % of the picture."""


class DepthSensor:
    """Makes depth pictures; the same moment of the same world gives the same picture.

    Args:
        mount: the camera that the pictures are aligned to.
        seed: of its calibration and its noise.
    """

    def __init__(self, mount: CameraMount, seed: int) -> None:
        focal_px = mount.width_px / (2 * np.tan(mount.horizontal_fov_rad / 2))
        self._disparity_px_m = np.float32(focal_px * _BASE_M)
        self._width_px = mount.width_px
        self._seed = seed
        calibration = np.random.default_rng([seed, 61])
        self._scale = np.float32(1.0 + _SCALE_SIGMA * calibration.standard_normal())

    def measure(self, true_m: Metres, t_s: float) -> NDArray[np.uint16]:
        """The depth picture, (H, W) uint16 mm, 0 for no measurement.

        Args:
            true_m: (H, W) along the optical axis; 0 for what is beyond all ranges.
            t_s: simulated time.
        """
        rng = np.random.default_rng([self._seed, 62, round(t_s * 1e6)])
        there = true_m > 0
        true_px = np.where(there, self._disparity_px_m / np.where(there, true_m, 1), 0)
        noise, dark = (_patches(rng, true_m.shape) for _ in range(2))
        told_px = true_px * self._scale + _DISPARITY_SIGMA_PX * noise
        edge = _edges(true_px)
        chance = rng.random(true_m.shape, np.float32)
        stray = edge & (chance > 1 - _STRAY_SHARE)
        told_px[stray] = cv2.blur(told_px, (3, 3))[stray]
        told_px = np.rint(told_px * _STEPS_PER_PX) / _STEPS_PER_PX
        seen = there & (told_px > 0) & (dark < _DARK_SHARE_SIGMAS)
        seen &= ~(edge & (chance < _EDGE_HOLES))
        seen &= ~self._hidden_from_one(true_px)
        told_m = self._disparity_px_m / np.where(seen, told_px, 1)
        seen &= (told_m >= _NEAREST_M) & (told_m <= _FARTHEST_M)
        return np.where(seen, np.rint(told_m * 1000), 0).astype(np.uint16)

    def _hidden_from_one(self, disparity_px: Metres) -> NDArray[np.bool_]:
        """What something to the right of it hides from the right lens."""
        scale = disparity_px.shape[1] / self._width_px
        columns = np.arange(disparity_px.shape[1], dtype=np.float32)
        right = columns - disparity_px * scale
        foremost = np.minimum.accumulate(right[:, ::-1], axis=1)[:, ::-1]
        return np.asarray(foremost < right - 0.5, np.bool_)


def _patches(rng: np.random.Generator, shape: tuple[int, ...]) -> Metres:
    """(H, W) noise of deviation 1 that is alike over patches."""
    height, width = shape[0], shape[1]
    coarse = rng.standard_normal((height // _PATCH_PX + 2, width // _PATCH_PX + 2), np.float32)
    fine = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    return np.asarray(fine / max(float(fine.std()), 1e-6), np.float32)


def _edges(disparity_px: Metres) -> NDArray[np.bool_]:
    """Where the distance steps within a pixel to either side."""
    kernel = np.ones((3, 3), np.uint8)
    most, least = cv2.dilate(disparity_px, kernel), cv2.erode(disparity_px, kernel)
    return np.asarray(most - least > _EDGE_SHARE * most, np.bool_)
