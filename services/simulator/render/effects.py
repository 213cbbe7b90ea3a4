"""What a real camera adds to a clean picture: exposure that lags, motion blur, sensor noise."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

_LEVELS = 8
"""Strengths of noise made beforehand, half a power of two apart: gains of a quarter to 32."""
_MARGIN_PX = 64
"""Noise is larger than the picture by this, and shifted anew in every frame: 4,096 places before
one repeats."""


@dataclass(frozen=True, slots=True)
class CameraEffects:
    """How bad the camera is; zeros make it perfect.

    Attributes:
        noise_grey: deviation of the sensor's noise at normal exposure, grey levels.
        shutter_s: exposure time, which turns rotation into blur.
        exposure_lag_s: time constant of the automatic exposure.
        max_gain: most by which it can brighten or darken.
    """

    noise_grey: float = 2.2
    shutter_s: float = 0.012
    exposure_lag_s: float = 0.6
    max_gain: float = 4.0


class CameraFilter:
    """Applies the effects to one frame after the other.

    The exposure depends on the frames before, everything else on the moment alone: the same
    series of frames gives the same pixels.

    Args:
        effects: how strong.
        size_px: height and width.
        focal_px: of the pinhole.
        seed: of the noise.
    """

    def __init__(
        self, effects: CameraEffects, size_px: tuple[int, int], focal_px: float, seed: int
    ) -> None:
        self._effects = effects
        self._size = size_px
        self._focal_px = focal_px
        self._seed = seed
        self._gain = 1.0
        self._t_s: float | None = None
        rng = np.random.default_rng([seed, 51])
        height, width = size_px[0] + _MARGIN_PX, size_px[1] + _MARGIN_PX
        noise = rng.standard_normal((height, width, 3), np.float32)
        # Strengths in steps of the square root of two: noise grows with the root of the gain.
        self._noise = [
            np.rint(noise * effects.noise_grey * 2 ** (level / 2 - 1)).astype(np.int16)
            for level in range(_LEVELS)
        ] if effects.noise_grey else []  # fmt: skip

    def apply(
        self, image: NDArray[np.uint8], t_s: float, brightness: float, turn_radps: float
    ) -> NDArray[np.uint8]:
        """The picture as the camera delivers it.

        Args:
            image: (H, W, 3) uint8 BGR, in normal light.
            t_s: simulated time.
            brightness: of the light, 1 is normal.
            turn_radps: of the camera about the upright axis.
        """
        self._expose(t_s, brightness)
        image = self._blur(image, turn_radps)
        light = brightness * self._gain
        if abs(light - 1.0) > 1e-3:
            table = np.clip(np.arange(256) * light, 0, 255).astype(np.uint8)
            image = np.asarray(cv2.LUT(image, table), np.uint8)
        return self._add_noise(image, t_s)

    def _expose(self, t_s: float, brightness: float) -> None:
        """Move the gain towards the one that would make the light normal."""
        most = self._effects.max_gain
        wanted = min(max(1.0 / max(brightness, 1e-3), 1.0 / most), most)
        if self._t_s is None or self._effects.exposure_lag_s == 0:
            self._gain = wanted
        else:
            kept = np.exp(-max(0.0, t_s - self._t_s) / self._effects.exposure_lag_s)
            self._gain = float(wanted + (self._gain - wanted) * kept)
        self._t_s = t_s

    def _blur(self, image: NDArray[np.uint8], turn_radps: float) -> NDArray[np.uint8]:
        """Smear along the rows by the way that the picture moves while the shutter is open."""
        way_px = self._focal_px * abs(turn_radps) * self._effects.shutter_s
        if way_px < 0.3:
            return image
        half = int(np.ceil(way_px / 2))
        kernel = np.clip((way_px + 1) / 2 - np.abs(np.arange(-half, half + 1)) + 0.5, 0, 1)
        kernel /= kernel.sum()
        return np.asarray(cv2.sepFilter2D(image, -1, kernel, np.ones(1)), np.uint8)

    def _add_noise(self, image: NDArray[np.uint8], t_s: float) -> NDArray[np.uint8]:
        if not self._noise:
            return image
        # Drawn from the moment itself, so that the same moment has the same noise.
        rng = np.random.default_rng([self._seed, 52, round(t_s * 1e6)])
        top, left = rng.integers(0, _MARGIN_PX, 2).tolist()
        level = round(min(max(np.log2(self._gain) + 2, 0), _LEVELS - 1))
        height, width = self._size
        noise = self._noise[level][top : top + height, left : left + width]
        return np.asarray(cv2.add(image, noise, dtype=cv2.CV_8U), np.uint8)
