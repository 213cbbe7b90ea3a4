"""Where the person is and what is in the way, to velocity within limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

from heel.services.follower.clearance import Room, speed_to_stop_within_mps
from heel.services.follower.limits import LimitedVelocity
from heel.services.follower.settings import FollowerSettings
from heel.services.follower.swing import Swing

_BRAKING_SHARE = 0.7
"""Of the braking limit that is planned with; the rest is for jerk and for what was not foreseen."""
_STANDING_MPS = 0.15
"""Slower people stand, as far as their estimate can tell."""
_SMOOTHED_S = 0.1
"""Seconds by which a person that stops dead is seen to do so later: trackers smooth boxes."""
_DISTANCE_DEADBAND_M = 0.1
"""Error of the distance that is left alone: people sway by so much where they stand."""
_BEARING_DEADBAND_RAD = 0.03
"""Error of the bearing that is left alone: boxes scatter by so much."""
_NEAR_M = 0.5
"""Metres; nearer people are reckoned with at this distance, so that rates stay finite."""
_TOO_NEAR_M = 0.2
"""Metres: nearer than wished by so much, the robot does not follow on. Chosen by hand."""
_AS_WISHED_MPS = 0.05
"""Speeds that differ by less are the same in a reason that a user reads."""
_TURNS_FIRST = 0.75
"""Share of the speed that is left by the bearing, below which turning is what holds it up."""


@dataclass(frozen=True, slots=True)
class Goal:
    """The person to follow, as the robot will see them when its command takes effect.

    Attributes:
        place: metres ahead and to the left.
        velocity: over ground, in the robot's axes.
    """

    place: tuple[float, float]
    velocity: tuple[float, float]

    @property
    def distance_m(self) -> float:
        """Along the ground."""
        return math.hypot(*self.place)

    @property
    def bearing_rad(self) -> float:
        """Left is positive."""
        return math.atan2(self.place[1], self.place[0])


class VelocityController:
    """Proportional law with feed-forward, deadbands and limits.

    Forward: `gain * (distance - wished) + speed of the person along the line of sight`, so that
    a person that walks steadily is followed without lagging behind. It falls with the bearing, so
    that the robot turns first. Turning likewise. A stop is immediate: the limits on acceleration
    and jerk shape motion, they never prolong it.
    """

    def __init__(self, settings: FollowerSettings) -> None:
        s = self._settings = settings
        self._linear = LimitedVelocity(s.max_linear_mps2, s.max_braking_mps2, s.max_linear_mps3)
        self._angular = LimitedVelocity(
            s.max_angular_radps2, s.max_angular_radps2, s.max_angular_radps3
        )
        self._swing = Swing()
        self._time_s = 0.0
        self.speed_reason = ""
        """What bounds the speed that was told last; empty while nothing moves."""

    @property
    def swings(self) -> bool:
        """Whether the robot has been turning to and fro, and turns more gently for it."""
        return self._swing.swings

    @property
    def linear_mps(self) -> float:
        """What was told last."""
        return self._linear.velocity

    def stop(self) -> tuple[float, float]:
        """Zero velocity at once."""
        self._linear.stop()
        self._angular.stop()
        self.speed_reason = ""
        return 0.0, 0.0

    def follow(
        self, goal: Goal, room: Room, sidestep_rad: float, dt_s: float,
        most_mps: float = math.inf,
    ) -> tuple[float, float]:  # fmt: skip
        """Linear (m/s) and angular (rad/s) velocity for the next `dt_s` seconds.

        Args:
            goal: the person.
            room: how far the robot may go ahead and back.
            sidestep_rad: by how much to head beside the person.
            dt_s: since the last command.
            most_mps: after somebody out of sight the robot goes no faster.
        """
        wished, why = self._wished_linear(goal)
        if wished > most_mps:
            wished, why = most_mps, "no faster after somebody out of sight"
        linear = self._forward(wished, why, room, dt_s)
        wished_radps = self._swing.share * self._wished_angular(goal, linear, sidestep_rad)
        angular = self._turn(wished_radps, dt_s)
        self._time_s += dt_s
        self._swing.told(self._time_s, angular)
        return linear, angular

    def by_hand(
        self, linear_mps: float, angular_radps: float, room: Room, dt_s: float
    ) -> tuple[float, float]:
        """As a hand wishes, within the same limits and the same room as following.

        Args:
            linear_mps: wished, forward is positive.
            angular_radps: wished, left is positive.
            room: how far the robot may go ahead and back.
            dt_s: since the last command.
        """
        linear = self._forward(linear_mps, "driven by hand", room, dt_s)
        if linear_mps < 0.0 and self._settings.max_reverse_mps == 0.0:
            self.speed_reason = "backward is forbidden: max_reverse_mps is 0"
        return linear, self._turn(angular_radps, dt_s)

    def brake_and_turn(self, angular_radps: float, dt_s: float) -> tuple[float, float]:
        """Come to a stop as fast as the limits allow, and turn as told."""
        self.speed_reason = "out of sight: braking"
        return self._linear.towards(0.0, dt_s), self._turn(angular_radps, dt_s)

    def turn(self, angular_radps: float, dt_s: float) -> tuple[float, float]:
        """Turn on the spot."""
        self._linear.stop()
        self.speed_reason = "turning on the spot"
        return 0.0, self._turn(angular_radps, dt_s)

    def turn_to(self, bearing_rad: float, at_most_radps: float) -> float:
        """The turn rate that brings a direction before the robot, for `turn`."""
        s = self._settings
        angular = s.angular_gain_per_s * _outside(bearing_rad, _BEARING_DEADBAND_RAD)
        return min(max(angular, -at_most_radps), at_most_radps)

    def _wished_linear(self, goal: Goal) -> tuple[float, str]:
        s = self._settings
        distance_m, bearing_rad = goal.distance_m, goal.bearing_rad
        error_m = _outside(distance_m - s.distance_m, _DISTANCE_DEADBAND_M)
        away_mps = (
            goal.place[0] * goal.velocity[0] + goal.place[1] * goal.velocity[1]
        ) / max(distance_m, _NEAR_M)  # fmt: skip
        # The robot does not hurry after a person from too near: walking speed is least sure there.
        share = min(max(1.0 - (s.distance_m - distance_m) / _TOO_NEAR_M, 0.0), 1.0)
        ahead_mps = share * _faded_in(away_mps, _STANDING_MPS)
        wished = s.linear_gain_per_s * error_m + min(ahead_mps, away_mps)
        # Nothing is driven at what is more than 45 degrees off: the robot turns on the spot.
        towards = max(0.0, math.cos(2.0 * bearing_rad)) * (abs(bearing_rad) < math.pi / 4)
        if towards < _TURNS_FIRST:
            why = "turning first"
        elif wished <= _AS_WISHED_MPS:
            why = "at the wished distance" if error_m >= 0.0 else "nearer than wished"
        else:
            why = "keeping the distance" if error_m <= 0.0 else "closing up"
        return wished * towards, why

    def _wished_angular(self, goal: Goal, linear_mps: float, sidestep_rad: float) -> float:
        """Bearing error, and how fast the person passes by; unreliable when they are near."""
        s = self._settings
        passing = goal.place[0] * goal.velocity[1] - goal.place[1] * (goal.velocity[0] - linear_mps)
        passing_radps = passing / max(goal.distance_m, _NEAR_M) ** 2
        error = _outside(goal.bearing_rad + sidestep_rad, _BEARING_DEADBAND_RAD)
        return s.angular_gain_per_s * error + _outside(passing_radps, 0.05)

    def _forward(self, wished: float, why: str, room: Room, dt_s: float) -> float:
        s = self._settings
        ahead, behind = self._allowed(room.ahead_m), self._allowed(room.behind_m)
        if wished > min(s.max_linear_mps, ahead):
            why = "speed limit" if s.max_linear_mps <= ahead else room.ahead_ends_at
        wished = min(max(wished, -min(s.max_reverse_mps, behind)), min(s.max_linear_mps, ahead))
        self.speed_reason = why
        present = self._linear.velocity
        room_m = room.ahead_m if present > 0 else room.behind_m
        # Too late to brake within the limits: something has just appeared.
        if present * present > 2 * s.max_braking_mps2 * room_m:
            self._linear.stop()
            self.speed_reason = room.ahead_ends_at if present > 0 else "something behind"
            return 0.0
        linear = self._linear.towards(wished, dt_s)
        if abs(linear - wished) > _AS_WISHED_MPS:
            verb = "speeding up" if abs(wished) > abs(linear) else "slowing down"
            self.speed_reason = f"{verb}: {why}"
        return linear

    def _turn(self, wished: float, dt_s: float) -> float:
        limit = self._settings.max_angular_radps
        return self._angular.towards(min(max(wished, -limit), limit), dt_s)

    def _allowed(self, room_m: float) -> float:
        s = self._settings
        return speed_to_stop_within_mps(
            room_m, _BRAKING_SHARE * s.max_braking_mps2, 2 * s.robot_delay_s + _SMOOTHED_S
        )


def _faded_in(value: float, least: float) -> float:
    """Nothing below `least`, all from twice that on; a mere deadband would lag behind walkers."""
    return value * min(max(abs(value) / least - 1.0, 0.0), 1.0)


def _outside(error: float, deadband: float) -> float:
    return math.copysign(max(0.0, abs(error) - deadband), error)
