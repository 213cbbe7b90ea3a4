"""Where people mean to go: ways made of legs, and how far along a person is."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from heel.services.simulator.postures import Posture

_ROUND_CORNER_M = 0.4
"""A point of the way at which no person stops is passed within this; chosen by hand: walkers cut
corners."""
_STAND_WITHIN_M = 0.12
"""One at which a walker stops is reached within this; chosen by hand."""
_BRAKE_MPS2 = 0.8
"""Walkers slow down before a stop by this; chosen by hand: over the last metre."""
_HIDDEN_LIMIT_S = 20.0
"""Longest wait of a walker that is to stay out of sight, should the robot never look away; chosen
by hand."""
_STROLL_MPS = 0.2
"""Slower than this a walker stands; chosen by hand."""
_GET_GOING_S = 0.3
"""What starting from a stand costs."""
_CATCH_UP_S = 0.5
"""Time in which a person that pushes makes up for what is lacking; chosen by hand."""
_BESIDE_M = 1.0
"""A point that lies behind a walker counts as passed within this; chosen by hand."""


@dataclass(frozen=True, slots=True)
class Leg:
    """Walk straight to a place, and stay there.

    Attributes:
        pause_s: stands there so long.
        hidden_s: stands there until obstacles have hidden the person from the robot for so long
            since the leg began, at most 20 s: what a pillar or a door hides depends on where the
            robot waits.
        posture: taken while staying there.
        close: whether the person keeps no air to others, as those who hug.
    """

    x_m: float
    y_m: float
    pause_s: float = 0.0
    hidden_s: float = 0.0
    posture: Posture = "upright"
    close: bool = False


@dataclass(frozen=True, slots=True)
class Pushing:
    """Stay right behind the target wherever it goes, as a person that pushes its wheelchair.

    Attributes:
        behind_m: from middle to middle.
    """

    behind_m: float


@dataclass(frozen=True, slots=True)
class Crossing:
    """Cross the target's way at a place, just behind the target: before the robot that follows it.

    Waits for the moment to set off, and then walks straight on whatever the target does.

    Attributes:
        behind_m: how far the target shall be past the place by then.
    """

    x_m: float
    y_m: float
    behind_m: float


AnyLeg = Leg | Crossing | Pushing


@dataclass(frozen=True, slots=True)
class Walk:
    """One person's way.

    Attributes:
        speed_mps: at ease.
        legs: one after the other; the person stays at the end of the last.
        start_s: not before this time.
        posture: while moving.
        at_first: posture before `start_s`.
    """

    speed_mps: float
    legs: tuple[AnyLeg, ...] = ()
    start_s: float = 0.0
    posture: Posture = "upright"
    at_first: Posture | None = None


@dataclass(frozen=True, slots=True)
class Situation:
    """What a walker looks at. Places in metres, velocities in metres per second."""

    t_s: float
    dt_s: float
    target: tuple[float, float]
    target_velocity: tuple[float, float]
    is_hidden: Callable[[float, float], bool]


class Walker:
    """How far along a walk a person is.

    Attributes:
        posture: wished for now; a person that gets up walks on once it stands.
    """

    def __init__(self, walk: Walk, x_m: float, y_m: float) -> None:
        self.posture: Posture = walk.at_first or walk.posture
        self._walk = walk
        self._came_from = (x_m, y_m)
        self._index = 0
        self._arrived = False
        self._stayed_s = 0.0
        self._hidden_s = 0.0
        self._set_off = False

    @property
    def close(self) -> bool:
        """Whether the person keeps no air to others now."""
        leg = None if self.finished else self._walk.legs[self._index]
        return isinstance(leg, Pushing) or (isinstance(leg, Leg) and leg.close)

    @property
    def finished(self) -> bool:
        """Whether the end of the last leg is reached."""
        return self._index == len(self._walk.legs)

    def wish(self, x_m: float, y_m: float, situation: Situation) -> tuple[float, float]:
        """The velocity that a person at (x, y) would like to have now; (0, 0) to stand."""
        if situation.t_s < self._walk.start_s:
            return 0.0, 0.0
        self.posture = self._walk.posture
        while not self.finished:
            leg = self._walk.legs[self._index]
            if isinstance(leg, Pushing):
                return _push_along(x_m, y_m, leg, self._walk.speed_mps, situation)
            self._arrived = self._arrived or self._has_reached(leg, x_m, y_m)
            if isinstance(leg, Leg) and leg.hidden_s > 0 and situation.is_hidden(x_m, y_m):
                self._hidden_s += situation.dt_s
            if not self._arrived:
                return _towards(x_m, y_m, leg, self._pace_mps(leg, x_m, y_m, situation))
            if isinstance(leg, Leg) and self._stays(leg, situation.dt_s):
                self.posture = leg.posture if leg.posture != "upright" else self._walk.posture
                return 0.0, 0.0
            self._next_leg(x_m, y_m)
        return 0.0, 0.0

    def _next_leg(self, x_m: float, y_m: float) -> None:
        self._came_from = (x_m, y_m)
        self._index += 1
        self._arrived = self._set_off = False
        self._stayed_s = self._hidden_s = 0.0

    def _is_stop(self, leg: Leg | Crossing) -> bool:
        if isinstance(leg, Crossing):
            return False
        return leg.pause_s > 0 or leg.hidden_s > 0 or self._index == len(self._walk.legs) - 1

    def _has_reached(self, leg: Leg | Crossing, x_m: float, y_m: float) -> bool:
        ahead_x, ahead_y = leg.x_m - x_m, leg.y_m - y_m
        distance = math.hypot(ahead_x, ahead_y)
        if self._is_stop(leg):
            return distance < _STAND_WITHIN_M
        way_x, way_y = leg.x_m - self._came_from[0], leg.y_m - self._came_from[1]
        # A person that was pushed aside and walked past need not turn back for the corner.
        passed = distance < _BESIDE_M and ahead_x * way_x + ahead_y * way_y < 0
        return distance < _ROUND_CORNER_M or passed

    def _pace_mps(self, leg: Leg | Crossing, x_m: float, y_m: float, situation: Situation) -> float:
        distance = math.hypot(leg.x_m - x_m, leg.y_m - y_m)
        if isinstance(leg, Crossing):
            return self._crossing_pace_mps(leg, distance, situation)
        if self._is_stop(leg):
            return min(self._walk.speed_mps, math.sqrt(2 * _BRAKE_MPS2 * distance))
        return self._walk.speed_mps

    def _stays(self, leg: Leg, dt_s: float) -> bool:
        self._stayed_s += dt_s
        waits = self._hidden_s < leg.hidden_s and self._stayed_s < _HIDDEN_LIMIT_S
        return waits or self._stayed_s < leg.pause_s

    def _crossing_pace_mps(self, leg: Crossing, distance_m: float, situation: Situation) -> float:
        """0 until the moment; then so as to be there in time, within a quarter of the own pace."""
        ease_mps = self._walk.speed_mps
        (target_x, target_y), (velocity_x, velocity_y) = situation.target, situation.target_velocity
        speed = math.hypot(velocity_x, velocity_y)
        if speed < _STROLL_MPS:
            return ease_mps if self._set_off else 0.0
        along_x, along_y = velocity_x / speed, velocity_y / speed
        ahead_m = (leg.x_m - target_x) * along_x + (leg.y_m - target_y) * along_y
        left_s = (ahead_m + leg.behind_m) / speed
        if not self._set_off:
            # A person that would come too late lets the robot pass.
            due = left_s <= distance_m / ease_mps + _GET_GOING_S
            self._set_off = due and left_s > 0.7 * distance_m / ease_mps
            return ease_mps if self._set_off else 0.0
        pace = distance_m / left_s if left_s > 0.0 else math.inf
        return min(max(pace, 0.75 * ease_mps), 1.25 * ease_mps)


def _push_along(
    x_m: float, y_m: float, leg: Pushing, speed_mps: float, situation: Situation
) -> tuple[float, float]:
    """To the place behind the target, as fast as it goes; stands where the target does."""
    (target_x, target_y), (velocity_x, velocity_y) = situation.target, situation.target_velocity
    speed = math.hypot(velocity_x, velocity_y)
    if speed < _STROLL_MPS:
        return 0.0, 0.0
    wish_x = velocity_x + (target_x - leg.behind_m * velocity_x / speed - x_m) / _CATCH_UP_S
    wish_y = velocity_y + (target_y - leg.behind_m * velocity_y / speed - y_m) / _CATCH_UP_S
    share = min(1.0, speed_mps / max(math.hypot(wish_x, wish_y), 1e-6))
    return share * wish_x, share * wish_y


def _towards(x_m: float, y_m: float, goal: Leg | Crossing, speed_mps: float) -> tuple[float, float]:
    away_x, away_y = goal.x_m - x_m, goal.y_m - y_m
    distance = max(math.hypot(away_x, away_y), 1e-6)
    return speed_mps * away_x / distance, speed_mps * away_y / distance
