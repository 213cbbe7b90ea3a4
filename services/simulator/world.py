"""The simulated world: people, light, camera and a robot, moved on step by step from one seed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from heel.schemas import (
    Odometry,
    Pose,
    Ranges,
    SimObstacle,
    SimPerson,
    SimTruth,
    SimWorld,
)
from heel.services.simulator.errors import SimulatorError
from heel.services.simulator.people import Crowd
from heel.services.simulator.robot import Drivetrain, RobotBody, wrap
from heel.services.simulator.script import Scenario
from heel.services.simulator.sensors import RangeRing, WheelOdometry
from heel.services.simulator.solids import Solids
from heel.services.simulator.state import CameraMount, Obstacle, PersonState, RobotState, Scenery
from heel.services.simulator.views import look

Array = NDArray[np.float64]

MAX_STEP_S = 0.1
"""Longest step: at 2 m/s a robot goes 0.2 m in it, less than a person is wide."""
_APART_M = 0.05
"""A contact ends, and another can begin, with this much air between."""


class World:
    """One episode. The same scenario, seed and commands give the same bytes.

    Args:
        scenario: what is there at the start.
        seed: of everything that is left to chance from then on.
        body: what the robot can do.
    """

    def __init__(self, scenario: Scenario, seed: int, body: RobotBody | None = None) -> None:
        self.scenario = scenario
        self.seed = seed
        self._body = body or RobotBody()
        # Streams of their own: how often a sensor is read must not change how people move.
        drive, odometry, ranges = np.random.default_rng(seed).spawn(3)
        self._solids = Solids(scenario.scenery.obstacles)
        self._crowd = Crowd(scenario.people, self._solids)
        self._drivetrain = Drivetrain(self._body, drive)
        self._odometry = WheelOdometry(odometry)
        self._ranges = RangeRing(ranges)
        self._robot = scenario.robot
        self._t_s = 0.0
        self._people: tuple[PersonState, ...] | None = None
        self._in_contact = np.zeros(len(scenario.people), np.bool_)
        self._free_m = 0.0
        self._contacts = 0

    @property
    def t_s(self) -> float:
        """Simulated time since the start."""
        return self._t_s

    @property
    def scenery(self) -> Scenery:
        """What does not move."""
        return self.scenario.scenery

    @property
    def robot(self) -> RobotState:
        """The robot now."""
        return self._robot

    @property
    def robot_radius_m(self) -> float:
        """The robot's body is a disc."""
        return self._body.radius_m

    @property
    def people(self) -> tuple[PersonState, ...]:
        """All people, by id; ids count from 1."""
        if self._people is None:
            self._people = self._take_stock()
        return self._people

    @property
    def target(self) -> PersonState:
        """The person to follow."""
        return next(person for person in self.people if person.role == "target")

    @property
    def brightness(self) -> float:
        """Of all light, 1 is normal."""
        level = 1.0
        for from_s, brightness in self.scenario.lights:
            if self._t_s >= from_s:
                level = brightness
        return level

    @property
    def camera_on(self) -> bool:
        """False while the camera drops out."""
        return not any(from_s <= self._t_s < until_s for from_s, until_s in self.scenario.dropouts)

    @property
    def contacts(self) -> int:
        """How often the robot has come to touch a person so far."""
        return self._contacts

    @property
    def finished(self) -> bool:
        """Whether the episode's time is over."""
        return self._t_s >= self.scenario.duration_s

    def step(self, dt_s: float, linear_mps: float, angular_radps: float) -> None:
        """Go on by `dt_s` with the robot under this command.

        Args:
            dt_s: above 0, at most 0.1.
            linear_mps: forward is positive; the robot does what it can of it.
            angular_radps: left is positive.

        Raises:
            SimulatorError: a number that is not finite, or a step out of range.
        """
        if not (math.isfinite(linear_mps) and math.isfinite(angular_radps)):
            raise SimulatorError(
                f"the simulated robot was told to drive {linear_mps} m/s and {angular_radps} "
                f"rad/s: send finite numbers"
            )
        if not 0.0 < dt_s <= MAX_STEP_S:
            raise SimulatorError(
                f"a step of {dt_s} s is out of range: take above 0 and at most {MAX_STEP_S} s"
            )
        self._t_s = round(self._t_s + dt_s, 9)
        self._crowd.step(self._t_s, dt_s, self._robot, self._body.radius_m)
        self._people = None
        before = self._robot
        moved = self._drivetrain.step(before, dt_s, linear_mps, angular_radps)
        self._robot = self._come_to_rest(before, moved, dt_s)
        self._odometry.step(dt_s, self._robot.linear_mps, self._robot.angular_radps)

    def truth(self, seq: int, mount: CameraMount) -> SimTruth:
        """The world as it is now, with the boxes of all people as seen from `mount`."""
        sight = look(self, self._solids, mount)
        return SimTruth(
            seq=seq,
            t_s=self.t_s,
            robot=_pose(self._robot),
            robot_radius_m=self.robot_radius_m,
            linear_mps=self._robot.linear_mps,
            angular_radps=self._robot.angular_radps,
            people=tuple(
                SimPerson(
                    id=person.id,
                    role=person.role,
                    pose=_pose(person),
                    speed_mps=person.speed_mps,
                    height_m=person.height_m,
                    radius_m=person.radius_m,
                    box_xyxy=tuple(box) if in_front else None,
                    visible=visible,
                )
                for person, box, in_front, visible in zip(
                    self.people,
                    sight.box_xyxy.tolist(),
                    sight.in_front.tolist(),
                    sight.visible.tolist(),
                    strict=True,
                )
            ),
            contact=self._contacts,
        )

    def world_message(self) -> SimWorld:
        """What does not move."""
        return SimWorld(
            scenario=self.scenario.name,
            seed=self.seed,
            bounds_m=self.scenery.bounds_m,
            obstacles=tuple(
                SimObstacle(
                    pose=_pose(obstacle),
                    length_m=obstacle.length_m,
                    width_m=obstacle.width_m,
                    height_m=obstacle.height_m,
                    kind=obstacle.kind,
                )
                for obstacle in self.scenery.obstacles
            ),
        )

    def odometry(self, seq: int) -> Odometry:
        """Where the robot believes it is since its start; the belief drifts."""
        return self._odometry.message(seq)

    def ranges(self, seq: int) -> Ranges:
        """Free distances around the robot, obstacles and people alike."""
        crowd = self._crowd
        return self._ranges.message(seq, self._robot, self._solids, crowd.place, crowd.radius_m)

    def _come_to_rest(self, before: RobotState, moved: RobotState, dt_s: float) -> RobotState:
        """The robot where bodies and obstacles let it be."""
        wished = np.array([[moved.x_m, moved.y_m]])
        place = self._off_people(wished)
        place = self._off_obstacles(place)
        if (place == wished).all():
            return moved
        x_m, y_m = place[0].tolist()
        ahead = (x_m - before.x_m) * math.cos(moved.heading_rad) + (y_m - before.y_m) * math.sin(
            moved.heading_rad
        )
        # A robot that is held up has lost the speed; sliding along keeps its part of it.
        speed = max(min(ahead / dt_s, abs(moved.linear_mps)), -abs(moved.linear_mps))
        return replace(moved, x_m=x_m, y_m=y_m, linear_mps=speed)

    def _off_obstacles(self, place: Array) -> Array:
        """The robot slides along what it has come to touch."""
        self._free_m -= math.hypot(*(place[0] - (self._robot.x_m, self._robot.y_m)).tolist())
        if self._free_m > 0.0 or not len(self._solids):
            # It cannot have come near anything since the last look.
            return place
        place, _ = self._solids.push_out(place, np.array([self._body.radius_m]))
        self._free_m = float(self._solids.clearance(place)[0].min()) - self._body.radius_m
        return place

    def _off_people(self, place: Array) -> Array:
        """Count contacts; the robot stops at the body it has come to touch."""
        reach = self._crowd.radius_m + self._body.radius_m
        offset = place - self._crowd.place
        distance = np.sqrt((offset * offset).sum(1))
        touches = distance < reach
        self._contacts += int((touches & ~self._in_contact).sum())
        self._in_contact = touches | (self._in_contact & (distance < reach + _APART_M))
        if touches.any():
            first = int((distance - reach).argmin())
            depth = reach[first] - distance[first]
            place = place + depth * offset[first] / max(float(distance[first]), 1e-6)
        return place

    def _take_stock(self) -> tuple[PersonState, ...]:
        crowd = self._crowd
        speed = np.hypot(crowd.velocity[:, 0], crowd.velocity[:, 1])
        table = np.column_stack(
            [crowd.place, crowd.heading_rad, speed, crowd.stride_rad, crowd.shape]
        )
        return tuple(
            PersonState(
                id=number,
                role=actor.role,
                x_m=x_m,
                y_m=y_m,
                heading_rad=heading_rad,
                speed_mps=speed_mps,
                stride_rad=stride_rad,
                height_m=actor.height_m,
                radius_m=actor.radius_m,
                outfit=actor.outfit,
                tall=tall,
                wide=wide,
                carries=actor.carries,
            )
            for number, (
                actor,
                (x_m, y_m, heading_rad, speed_mps, stride_rad, tall, wide),
            ) in enumerate(zip(self.scenario.people, table.tolist(), strict=True), start=1)
        )


def _pose(thing: RobotState | PersonState | Obstacle) -> Pose:
    return Pose(x_m=thing.x_m, y_m=thing.y_m, heading_rad=wrap(thing.heading_rad))
