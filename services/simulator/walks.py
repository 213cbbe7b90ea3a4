"""Where people mean to go: ways made of legs, and how far along somebody is."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

_ROUND_CORNER_M = 0.4
_STAND_WITHIN_M = 0.12
_BRAKE_MPS2 = 0.8
_HIDDEN_LIMIT_S = 20.0
_CROSSING_LIMIT_S = 8.0
_BESIDE_M = 1.0


@dataclass(frozen=True, slots=True)
class Leg:
    """Walk straight to a place, and stay there.

    Attributes:
        pause_s: stands there so long.
        hidden_s: stands there until obstacles have hidden the person from the robot for so long,
            at most 20 s: what a pillar or a door hides depends on where the robot waits.
    """

    x_m: float
    y_m: float
    pause_s: float = 0.0
    hidden_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Crossing:
    """Walk through between the target and the robot, wherever they are by then.

    Attributes:
        behind_m: how far behind the target's centre, towards the robot.
    """

    behind_m: float


@dataclass(frozen=True, slots=True)
class Walk:
    """One person's way.

    Attributes:
        speed_mps: at ease.
        legs: one after the other; the person stays at the end of the last.
        start_s: not before this time.
        cue_m: not before the target has walked so far.
    """

    speed_mps: float
    legs: tuple[Leg | Crossing, ...] = ()
    start_s: float = 0.0
    cue_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Situation:
    """What a walker looks at. Places in metres, velocities in metres per second."""

    t_s: float
    dt_s: float
    robot: tuple[float, float]
    target: tuple[float, float]
    target_velocity: tuple[float, float]
    target_walked_m: float
    is_hidden: Callable[[float, float], bool]


class Walker:
    """How far along a walk somebody is."""

    def __init__(self, walk: Walk, x_m: float, y_m: float) -> None:
        self._walk = walk
        self._came_from = (x_m, y_m)
        self._index = 0
        self._arrived = False
        self._stayed_s = 0.0
        self._hidden_s = 0.0
        self._side = 0.0

    @property
    def finished(self) -> bool:
        """Whether the end of the last leg is reached."""
        return self._index == len(self._walk.legs)

    def wish(self, x_m: float, y_m: float, situation: Situation) -> tuple[float, float]:
        """The velocity that somebody at (x, y) would like to have now; (0, 0) to stand."""
        walk = self._walk
        if situation.t_s < walk.start_s or situation.target_walked_m < walk.cue_m:
            return 0.0, 0.0
        while not self.finished:
            leg = walk.legs[self._index]
            if isinstance(leg, Crossing):
                goal = self._crossing_goal(leg, x_m, y_m, situation)
                if goal is not None:
                    return _towards(x_m, y_m, *goal, walk.speed_mps)
            else:
                self._arrived = self._arrived or self._has_reached(leg, x_m, y_m)
                if not self._arrived:
                    return self._onward(leg, x_m, y_m)
                if self._stays(leg, x_m, y_m, situation):
                    return 0.0, 0.0
            self._next_leg(x_m, y_m)
        return 0.0, 0.0

    def _next_leg(self, x_m: float, y_m: float) -> None:
        self._came_from = (x_m, y_m)
        self._index += 1
        self._arrived = False
        self._stayed_s = self._hidden_s = self._side = 0.0

    def _is_stop(self, leg: Leg) -> bool:
        return leg.pause_s > 0 or leg.hidden_s > 0 or self._index == len(self._walk.legs) - 1

    def _has_reached(self, leg: Leg, x_m: float, y_m: float) -> bool:
        ahead_x, ahead_y = leg.x_m - x_m, leg.y_m - y_m
        distance = math.hypot(ahead_x, ahead_y)
        if self._is_stop(leg):
            return distance < _STAND_WITHIN_M
        way_x, way_y = leg.x_m - self._came_from[0], leg.y_m - self._came_from[1]
        # Somebody who was pushed aside and walked past need not turn back for the corner.
        passed = distance < _BESIDE_M and ahead_x * way_x + ahead_y * way_y < 0
        return distance < _ROUND_CORNER_M or passed

    def _onward(self, leg: Leg, x_m: float, y_m: float) -> tuple[float, float]:
        speed = self._walk.speed_mps
        if self._is_stop(leg):
            distance = math.hypot(leg.x_m - x_m, leg.y_m - y_m)
            speed = min(speed, math.sqrt(2 * _BRAKE_MPS2 * distance))
        return _towards(x_m, y_m, leg.x_m, leg.y_m, speed)

    def _stays(self, leg: Leg, x_m: float, y_m: float, situation: Situation) -> bool:
        self._stayed_s += situation.dt_s
        if leg.hidden_s > 0 and situation.is_hidden(x_m, y_m):
            self._hidden_s += situation.dt_s
        waits = self._hidden_s < leg.hidden_s and self._stayed_s < _HIDDEN_LIMIT_S
        return waits or self._stayed_s < leg.pause_s

    def _crossing_goal(
        self, leg: Crossing, x_m: float, y_m: float, situation: Situation
    ) -> tuple[float, float] | None:
        """Where to meet the line between robot and target; None once across, or too late."""
        self._stayed_s += situation.dt_s
        (robot_x, robot_y), (target_x, target_y) = situation.robot, situation.target
        back_x, back_y = robot_x - target_x, robot_y - target_y
        side = back_x * (y_m - target_y) - back_y * (x_m - target_x)
        self._side = self._side or side
        if self._side * side <= 0 or self._stayed_s > _CROSSING_LIMIT_S:
            return None
        share = leg.behind_m / max(math.hypot(back_x, back_y), leg.behind_m)
        goal_x, goal_y = target_x + share * back_x, target_y + share * back_y
        velocity_x, velocity_y = situation.target_velocity
        until_s = 0.0
        for _ in range(3):
            meet_x, meet_y = goal_x + velocity_x * until_s, goal_y + velocity_y * until_s
            until_s = math.hypot(meet_x - x_m, meet_y - y_m) / self._walk.speed_mps
        return meet_x, meet_y


def _towards(
    x_m: float, y_m: float, goal_x: float, goal_y: float, speed_mps: float
) -> tuple[float, float]:
    away_x, away_y = goal_x - x_m, goal_y - y_m
    distance = max(math.hypot(away_x, away_y), 1e-6)
    return speed_mps * away_x / distance, speed_mps * away_y / distance
