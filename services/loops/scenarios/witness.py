"""Watches an episode from outside, and writes down what really happens."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.evaluation.following.log import NOBODY, EpisodeLog
from heel.schemas import FollowState, SimTruth
from heel.services.loops.judge import acted_upon
from heel.services.loops.scenarios.floor import Floor
from heel.services.simulator.world import World

Reals = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Moment:
    """What changes from one row of the log to the next.

    Attributes:
        robot: x, y (m), heading (rad), linear (m/s) and angular velocity (rad/s).
        people_m: x, y of everybody.
        visible: share of everybody's box that was to be seen in the newest picture.
        contact: whether the robot has touched a person by now.
    """

    t_s: float
    robot: tuple[float, float, float, float, float]
    people_m: list[tuple[float, float]]
    visible: list[float]
    contact: bool

    @classmethod
    def of_world(cls, world: World, visible: list[float]) -> Moment:
        """A world now."""
        robot = world.robot
        return cls(
            world.t_s,
            (robot.x_m, robot.y_m, robot.heading_rad, robot.linear_mps, robot.angular_radps),
            [(person.x_m, person.y_m) for person in world.people],
            visible,
            world.contacts > 0,
        )

    @classmethod
    def of_truth(cls, truth: SimTruth) -> Moment:
        """A world that another process told of."""
        robot = truth.robot
        return cls(
            truth.t_s,
            (robot.x_m, robot.y_m, robot.heading_rad, truth.linear_mps, truth.angular_radps),
            [(person.pose.x_m, person.pose.y_m) for person in truth.people],
            [person.visible for person in truth.people],
            truth.contact > 0,
        )


class Witness:
    """Collects the log of one episode.

    Args:
        world: the episode's, for what never changes in it.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._target = [person.role for person in world.people].index("target")
        self._moments: list[Moment] = []
        self._followed: list[int] = []
        self._identities: list[list[int]] = []
        self._states: list[str] = []

    def record(self, moment: Moment, state: FollowState, people: dict[int, int]) -> None:
        """Write down this moment.

        Args:
            moment: the world.
            state: what the follower does now.
            people: index of the person by track id, of the newest tracks that the follower has.
        """
        self._moments.append(moment)
        person = acted_upon(state, people)
        self._followed.append(NOBODY if person is None else person)
        identities = [NOBODY] * len(moment.people_m)
        for track_id, index in people.items():
            identities[index] = track_id
        self._identities.append(identities)
        self._states.append(state.state)

    def log(self) -> EpisodeLog:
        """Everything that was written down."""
        robot = np.array([moment.robot for moment in self._moments])
        people = np.array([moment.people_m for moment in self._moments])
        visible = np.array([moment.visible for moment in self._moments])
        target = people[:, self._target]
        floor = Floor(self._world.scenery.obstacles)
        return EpisodeLog(
            planned_s=self._world.scenario.duration_s,
            robot_radius_m=self._world.robot_radius_m,
            people_radius_m=np.array([person.radius_m for person in self._world.people]),
            target=self._target,
            t_s=np.array([moment.t_s for moment in self._moments]),
            robot_xy_m=robot[:, :2],
            robot_heading_rad=robot[:, 2],
            linear_mps=robot[:, 3],
            angular_radps=robot[:, 4],
            people_xy_m=people,
            path_m=floor.path_m(robot[:, :2], target),
            path_from_start_m=floor.path_m(np.broadcast_to(robot[0, :2], target.shape), target),
            visible=visible[:, self._target],
            people_visible=visible,
            identities=np.array(self._identities),
            followed=np.array(self._followed),
            contact=np.array([moment.contact for moment in self._moments]),
            state=np.array(self._states),
        )
