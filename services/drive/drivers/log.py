"""A driver that turns nothing and says what it would do."""

from __future__ import annotations

import logging

from heel.services.drive.drivers.base import Driver

_WORTH_A_LINE = 0.1
"""Change of a velocity that is logged, m/s or rad/s; chosen by hand."""
_log = logging.getLogger("heel.drive.wheels")


class LogDriver(Driver):
    """Logs when the wheels start, stop, or change by 0.1 m/s or 0.1 rad/s."""

    def __init__(self, options: str = "") -> None:
        self._told = (0.0, 0.0)

    def set_velocity(self, linear_mps: float, angular_radps: float) -> None:
        """Log it if it is news."""
        now = (linear_mps, angular_radps)
        starts_or_stops = any(now) != any(self._told)
        change = max(abs(a - b) for a, b in zip(now, self._told, strict=True))
        if starts_or_stops or change >= _WORTH_A_LINE:
            _log.info("wheels: %.2f m/s, %.2f rad/s", linear_mps, angular_radps)
            self._told = now
