"""Bearing and distance to velocity, within limits."""

from __future__ import annotations

import math

from services.follower.settings import FollowerSettings


class VelocityController:
    """Proportional law with deadbands, speed limits and acceleration limits.

    The forward speed falls with the cosine of the bearing, so that the robot turns first. A stop
    is immediate: acceleration limits shape motion, they never prolong it.
    """

    def __init__(self, settings: FollowerSettings) -> None:
        self._settings = settings
        self._linear_mps = 0.0
        self._angular_radps = 0.0

    def stop(self) -> tuple[float, float]:
        """Zero velocity at once."""
        self._linear_mps = self._angular_radps = 0.0
        return 0.0, 0.0

    def follow(self, distance_m: float, bearing_rad: float, dt_s: float) -> tuple[float, float]:
        """Linear (m/s) and angular (rad/s) velocity for the next `dt_s` seconds."""
        s = self._settings
        error_m = _outside(distance_m - s.distance_m, s.distance_deadband_m)
        # Nothing is driven at what is more than 45 degrees off: the robot turns on the spot.
        facing = max(0.0, math.cos(2.0 * bearing_rad)) if abs(bearing_rad) < math.pi / 4 else 0.0
        linear = s.linear_gain_per_s * error_m * facing
        linear = min(max(linear, -s.max_reverse_mps), s.max_linear_mps)
        angular = s.angular_gain_per_s * _outside(bearing_rad, s.bearing_deadband_rad)
        angular = min(max(angular, -s.max_angular_radps), s.max_angular_radps)
        self._linear_mps = _slew(self._linear_mps, linear, s.max_linear_mps2 * dt_s)
        self._angular_radps = _slew(self._angular_radps, angular, s.max_angular_radps2 * dt_s)
        return self._linear_mps, self._angular_radps


def _outside(error: float, deadband: float) -> float:
    return math.copysign(max(0.0, abs(error) - deadband), error)


def _slew(present: float, wished: float, step: float) -> float:
    return present + min(max(wished - present, -step), step)
