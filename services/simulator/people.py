"""How people move: towards where they mean to go, and out of each other's way.

Walkers look ahead: one that would come too close within two seconds is avoided sideways, the more
the sooner (predictive collision avoidance after Karamouzas, Heil, van Beek and Overmars, Motion in
Games 2009). People that stand do not step aside. None walks into the robot: only the robot's own
motion can close the last centimetres, so that contacts count against the robot.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from heel.services.simulator.postures import CHANGE_PER_S, FALL_PER_S, SHAPES
from heel.services.simulator.script import Actor
from heel.services.simulator.solids import Solids
from heel.services.simulator.state import RobotState
from heel.services.simulator.walks import Situation, Walker

Array = NDArray[np.float64]

_HORIZON_S = 2.0
"""Seconds that people look ahead for others in their way; chosen by hand."""
_PERSON_MARGIN_M = 0.35
"""Air that people keep between each other; chosen by hand."""
_ROBOT_MARGIN_M = 1.1
"""Air that people keep to a robot: more than to each other, since they do not know what it will do;
chosen by hand."""
_WALL_MARGIN_M = 0.35
"""Air that people keep to walls; chosen by hand."""
_AVOID_MPS = 1.2
"""Speed at which they step aside, at most; chosen by hand: a brisk walk."""
_MAX_MPS2 = 2.5
"""Largest change of a walker's velocity; chosen by hand: a stop from a walk within one step."""
_HURRY = 1.4
"""People walk so many times faster than they like, at most, to get out of the way; chosen by
hand."""
_TURN_RADPS = 3.5
"""Fastest turn of a body, half a circle in 0.9 s; chosen by hand."""
_ROBOT_GAP_M = 0.05
"""No person steps into this much air around the robot by themselves, so that every contact is the
robot's doing."""
_ON_THEIR_FEET = 0.95
"""Share of the height of walking from which on a person that gets up walks."""
_STRIDE_PER_HEIGHT = 0.8
"""Length of a double step over stature; 1.4 m at 1.75 m."""


class Crowd:
    """All people in the world, as arrays.

    Attributes:
        place: (N, 2) metres.
        velocity: (N, 2) metres per second.
        heading_rad: (N,).
        stride_rad: (N,) phase of the walking cycle, 2 pi a double step.
        shape: (N, 2) upper end and width now, as shares of the stature.
    """

    def __init__(self, people: tuple[Actor, ...], solids: Solids) -> None:
        self._solids = solids
        self._walkers = [Walker(actor.walk, actor.x_m, actor.y_m) for actor in people]
        self._target = next(i for i, actor in enumerate(people) if actor.role == "target")
        self._free_m = 0.0
        self._ease_mps = np.array([actor.walk.speed_mps for actor in people])
        self.height_m: Array = np.array([actor.height_m for actor in people])
        self.radius_m: Array = np.array([actor.radius_m for actor in people])
        self.place: Array = np.array([(actor.x_m, actor.y_m) for actor in people])
        self.velocity: Array = np.zeros_like(self.place)
        self.heading_rad: Array = np.array([actor.heading_rad for actor in people])
        self.stride_rad: Array = np.array([actor.stride_rad for actor in people])
        self._walking_tall = np.array([SHAPES[actor.walk.posture].tall for actor in people])
        self.shape: Array = self._wished_shape()

    def step(self, t_s: float, dt_s: float, robot: RobotState, robot_radius_m: float) -> None:
        """Move all by `dt_s`."""
        wish = self._wishes(t_s, dt_s, robot)
        self._change_posture(dt_s)
        down = self.shape[:, 0] < _ON_THEIR_FEET * self._walking_tall
        wish[down] = 0.0
        walking = (wish != 0.0).any(1)
        away = self._avoid_others(robot, robot_radius_m)
        # A person need not look out for walls that cannot have come near since the last look.
        near_walls = self._free_m <= 0.0 and len(self._solids) > 0
        if near_walls:
            away = away + self._avoid_solids()
        wanted = wish + np.where(walking[:, None], away, 0.0)
        wanted = _shorten(wanted, _HURRY * self._ease_mps)
        self.velocity = self.velocity + _shorten(wanted - self.velocity, _MAX_MPS2 * dt_s)
        before = self.place
        place = self._apart(before + self.velocity * dt_s)
        least = self._least_from_robot(before, robot, robot_radius_m)
        place = _push_from(place, robot, least)
        if near_walls:
            place, _ = self._solids.push_out(place, self.radius_m)
            # Between a wall and the robot there is no way through.
            squeezed = _distance(place, robot) < least - 1e-9
            place = np.where(squeezed[:, None], before, place)
        self.place = place
        moved = self.place - before
        self.velocity = _shorten(moved / dt_s, 2.0 * self._ease_mps)
        steps_m = np.hypot(moved[:, 0], moved[:, 1])
        self._free_m -= float(steps_m.max())
        self._stride(dt_s, steps_m)

    def _wishes(self, t_s: float, dt_s: float, robot: RobotState) -> Array:
        target_x, target_y = self.place[self._target].tolist()
        velocity_x, velocity_y = self.velocity[self._target].tolist()
        situation = Situation(
            t_s=t_s,
            dt_s=dt_s,
            target=(target_x, target_y),
            target_velocity=(velocity_x, velocity_y),
            is_hidden=lambda x_m, y_m: self._is_hidden(robot, x_m, y_m),
        )
        places = self.place.tolist()
        return np.array(
            [
                walker.wish(x_m, y_m, situation)
                for walker, (x_m, y_m) in zip(self._walkers, places, strict=True)
            ]
        )

    def _wished_shape(self) -> Array:
        shapes = [SHAPES[walker.posture] for walker in self._walkers]
        return np.array([(shape.tall, shape.wide) for shape in shapes])

    def _change_posture(self, dt_s: float) -> None:
        """Towards the posture that each wishes to be in."""
        wished = self._wished_shape()
        falls = np.array([walker.posture == "lying" for walker in self._walkers])
        most = np.where(falls, FALL_PER_S, CHANGE_PER_S)[:, None] * dt_s
        self.shape = self.shape + np.clip(wished - self.shape, -most, most)

    def _is_hidden(self, robot: RobotState, x_m: float, y_m: float) -> bool:
        """Whether obstacles as high as a person hide a body's whole width from the robot."""
        origin = np.array([robot.x_m, robot.y_m])
        ray = np.array([x_m, y_m]) - origin
        across = np.array([-ray[1], ray[0]]) / max(math.hypot(*ray.tolist()), 1e-6)
        rays = ray + 0.3 * across * np.array([[-1.0], [0.0], [1.0]])
        entry, _ = self._solids.cast(origin, rays)
        return bool(((entry < 1.0) & (self._solids.height_m > 2.0)).any(1).all())

    def _avoid_others(self, robot: RobotState, robot_radius_m: float) -> Array:
        """Velocity (N, 2) to add, from all (and the robot, the last column)."""
        count = len(self.place)
        robot_velocity = robot.linear_mps * np.array(
            [math.cos(robot.heading_rad), math.sin(robot.heading_rad)]
        )
        places = np.vstack([self.place, (robot.x_m, robot.y_m)])
        velocities = np.vstack([self.velocity, robot_velocity])
        offset = places - self.place[:, None]
        closing = self.velocity[:, None] - velocities
        approach = (offset * closing).sum(-1)
        until_s = approach / np.maximum((closing * closing).sum(-1), 1e-6)
        until_s = np.minimum(np.maximum(until_s, 0.0), _HORIZON_S)
        closest = offset - closing * until_s[..., None]
        # Two that meet head on both keep to the right.
        closest[..., 0] -= 0.1 * closing[..., 1]
        closest[..., 1] += 0.1 * closing[..., 0]
        distance = np.sqrt((closest * closest).sum(-1))
        radius = np.append(self.radius_m + _PERSON_MARGIN_M, robot_radius_m + _ROBOT_MARGIN_M)
        reach = self.radius_m[:, None] + radius
        strength = np.maximum(1.0 - distance / reach, 0.0) * (1.0 - until_s / _HORIZON_S)
        strength[np.arange(count), np.arange(count)] = 0.0
        strength[[walker.close for walker in self._walkers], :count] = 0.0
        facing = np.stack([np.cos(self.heading_rad), np.sin(self.heading_rad)], -1)
        seen = (offset * facing[:, None]).sum(-1) > -0.2 * np.sqrt((offset * offset).sum(-1))
        push = np.where(seen, strength, 0.0) / np.maximum(distance, 1e-6)
        away: Array = -_AVOID_MPS * (push[..., None] * closest).sum(1)
        return away

    def _avoid_solids(self) -> Array:
        distance, away = self._solids.clearance(self.place)
        gap = distance - self.radius_m[:, None] - _WALL_MARGIN_M
        self._free_m = float(gap.min())
        strength = np.minimum(np.maximum(-gap / _WALL_MARGIN_M, 0.0), 1.0)
        push: Array = _AVOID_MPS * (strength[..., None] * away).sum(1)
        return push

    def _apart(self, place: Array) -> Array:
        """Bodies are not soft: those that overlap each give way by half."""
        offset = place[:, None] - place
        distance = np.sqrt((offset * offset).sum(-1))
        overlap = np.maximum(self.radius_m[:, None] + self.radius_m - distance, 0.0)
        np.fill_diagonal(overlap, 0.0)
        if not overlap.any():
            return place
        share = 0.5 * overlap / np.maximum(distance, 1e-6)
        return np.asarray(place + (share[..., None] * offset).sum(1), np.float64)

    def _least_from_robot(self, place: Array, robot: RobotState, robot_radius_m: float) -> Array:
        """How near (N,) to the robot's centre people may come by themselves."""
        touching = self.radius_m + robot_radius_m
        return touching + np.minimum(_distance(place, robot) - touching, _ROBOT_GAP_M)

    def _stride(self, dt_s: float, step_m: Array) -> None:
        self.stride_rad = self.stride_rad + 2 * math.pi * step_m / (
            _STRIDE_PER_HEIGHT * self.height_m
        )
        course = np.arctan2(self.velocity[:, 1], self.velocity[:, 0])
        turn = np.remainder(course - self.heading_rad + math.pi, 2 * math.pi) - math.pi
        # A person that hardly moves keeps looking the same way.
        turn = np.where(step_m > 0.2 * dt_s, turn, 0.0)
        most = _TURN_RADPS * dt_s
        heading = self.heading_rad + np.minimum(np.maximum(turn, -most), most)
        self.heading_rad = np.remainder(heading + math.pi, 2 * math.pi) - math.pi


def _distance(place: Array, robot: RobotState) -> Array:
    """From the robot's centre (N,)."""
    offset = place - (robot.x_m, robot.y_m)
    return np.asarray(np.sqrt((offset * offset).sum(1)))


def _push_from(place: Array, robot: RobotState, least_m: Array) -> Array:
    """Places (N, 2), none nearer to the robot's centre than `least_m` (N,)."""
    centre = np.array([robot.x_m, robot.y_m])
    factor = np.maximum(least_m / np.maximum(_distance(place, robot), 1e-6), 1.0)
    return np.asarray(centre + (place - centre) * factor[:, None])


def _shorten(vectors: Array, most: Array | float) -> Array:
    """Vectors (N, 2), none longer than `most`."""
    length = np.sqrt((vectors * vectors).sum(1))
    factor = np.minimum(most / np.maximum(length, 1e-9), 1.0)
    return np.asarray(vectors * factor[:, None], np.float64)
