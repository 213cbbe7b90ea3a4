"""Changes of light and exposure, taken out of the pictures before colours are compared."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

_SIZE = (40, 30)
_DARKEST = 8
"""Grey levels below it say little about light."""
_MEMORY_S = 10.0
"""Ratios from frame to frame drift when they are multiplied: they are forgotten so slowly."""
_MOST = 3.0
_IGNORED = 1.02


class Exposure:
    """How much lighter the picture is than it was at first."""

    def __init__(self) -> None:
        self._before: NDArray[np.float32] | None = None
        self._log_gain = 0.0

    def level(self, image: NDArray[np.uint8], dt_s: float) -> NDArray[np.uint8]:
        """The picture as it would be in the light of the beginning.

        Args:
            image: (H, W, 3) uint8 BGR.
            dt_s: since the picture before.
        """
        small = cv2.resize(image, _SIZE, interpolation=cv2.INTER_AREA)
        grey = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), np.float32)
        before, self._before = self._before, grey
        if before is not None:
            told = (grey > _DARKEST) & (before > _DARKEST) & (grey < 250) & (before < 250)
            if np.count_nonzero(told) > 0.2 * grey.size:
                self._log_gain += float(np.median(np.log(grey[told] / before[told])))
        self._log_gain *= math.exp(-dt_s / _MEMORY_S)
        gain = min(max(math.exp(self._log_gain), 1.0 / _MOST), _MOST)
        if 1.0 / _IGNORED < gain < _IGNORED:
            return image
        table = np.clip(np.arange(256) / gain, 0, 255).astype(np.uint8)
        return np.asarray(cv2.LUT(image, table), np.uint8)
