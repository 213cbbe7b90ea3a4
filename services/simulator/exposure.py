"""A camera that adapts to the light, but not at once."""

from __future__ import annotations

import math

_ADAPTS_S = 0.5
"""Time constant of the gain; chosen by hand."""
_USABLE = 0.6
"""Log of the error of exposure at which pictures are about half as good."""


class Exposure:
    """Gain that follows the light with a delay."""

    def __init__(self) -> None:
        self._log_gain: float | None = None
        self._level = 1.0

    def expose(self, brightness: float, dt_s: float) -> None:
        """Take a picture `dt_s` after the one before; the first one finds the camera adapted."""
        wanted = -math.log(max(brightness, 1e-3))
        if self._log_gain is None:
            self._log_gain = wanted
        # The picture is taken with the gain of before.
        self._level = brightness * math.exp(self._log_gain)
        self._log_gain += (wanted - self._log_gain) * -math.expm1(-dt_s / _ADAPTS_S)

    @property
    def level(self) -> float:
        """How bright the picture is; 1 is right."""
        return self._level

    @property
    def gain(self) -> float:
        """By which noise is amplified as well; 1 in normal light."""
        return math.exp(self._log_gain or 0.0)

    @property
    def quality(self) -> float:
        """1 when rightly exposed, towards 0 when black or white."""
        return math.exp(-0.5 * (math.log(max(self._level, 1e-3)) / _USABLE) ** 2)
