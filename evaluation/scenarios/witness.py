"""Watches an episode from outside, and writes down what really happens."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evaluation.alignment import best_pairs
from evaluation.following.log import NOBODY, EpisodeLog
from evaluation.scenarios.floor import Floor
from schemas import FollowState, SimTruth, Tracks
from services.simulator.state import CameraMount
from services.simulator.world import World

_LEAST_IOU = 0.3
_ACTING = ("following", "occluded")
"""States in which the follower moves, or would, for the person its track is on."""

Reals = NDArray[np.float64]


class Witness:
    """Collects the log of one episode.

    Args:
        world: before its first step.
        mount: the robot's camera.
    """

    def __init__(self, world: World, mount: CameraMount) -> None:
        self._world = world
        self._mount = mount
        self._roles = [person.role for person in world.people]
        self._target = self._roles.index("target")
        self._visible = 0.0
        self._rows: list[tuple[float, float, float, float, float, float]] = []
        self._people: list[list[tuple[float, float]]] = []
        self._visibles: list[float] = []
        self._followed: list[int] = []
        self._states: list[str] = []
        self._contacts: list[bool] = []

    def see(self, truth: SimTruth) -> None:
        """Take in what the camera could see in the newest frame."""
        self._visible = truth.people[self._target].visible

    def people_of(self, truth: SimTruth, tracks: Tracks) -> dict[int, int]:
        """Who each track is on: index of the person by track id; tracks on nobody are left out.

        Tracks and people are paired one to one at the highest total IoU, from 0.3 on, within the
        picture. Others than the target only count while anything of them can be seen.
        """
        size = (self._mount.width_px, self._mount.height_px)
        present = [
            index
            for index, person in enumerate(truth.people)
            if person.box_xyxy is not None and (person.visible > 0 or index == self._target)
        ]
        boxes = _clipped([truth.people[index].box_xyxy or (0, 0, 0, 0) for index in present], size)
        ids = [track.id for track in tracks.tracks]
        overlaps = _ious(_clipped([track.box_xyxy for track in tracks.tracks], size), boxes)
        rows, columns = best_pairs(overlaps, _LEAST_IOU)
        return {ids[row]: present[column] for row, column in zip(rows, columns, strict=True)}

    def record(self, state: FollowState, people_by_track: dict[int, int]) -> None:
        """Write down this moment.

        Args:
            state: what the follower does now.
            people_by_track: of the newest tracks that the follower has.
        """
        world, robot = self._world, self._world.robot
        self._rows.append(
            (world.t_s, robot.x_m, robot.y_m, robot.heading_rad, robot.linear_mps,
             robot.angular_radps)
        )  # fmt: skip
        self._people.append([(person.x_m, person.y_m) for person in world.people])
        self._visibles.append(self._visible)
        acting = state.state in _ACTING and state.target.track_id is not None
        on = people_by_track.get(state.target.track_id or 0, NOBODY) if acting else NOBODY
        self._followed.append(on)
        self._states.append(state.state)
        self._contacts.append(world.contacts > 0)

    def log(self) -> EpisodeLog:
        """Everything that was written down."""
        rows = np.array(self._rows)
        people = np.array(self._people)
        target = people[:, self._target]
        floor = Floor(self._world.scenery.obstacles)
        return EpisodeLog(
            planned_s=self._world.scenario.duration_s,
            robot_radius_m=self._world.robot_radius_m,
            people_radius_m=np.array([person.radius_m for person in self._world.people]),
            target=self._target,
            t_s=rows[:, 0],
            robot_xy_m=rows[:, 1:3],
            robot_heading_rad=rows[:, 3],
            linear_mps=rows[:, 4],
            angular_radps=rows[:, 5],
            people_xy_m=people,
            path_m=floor.path_m(rows[:, 1:3], target),
            path_from_start_m=floor.path_m(np.broadcast_to(rows[0, 1:3], target.shape), target),
            visible=np.array(self._visibles),
            followed=np.array(self._followed),
            contact=np.array(self._contacts),
            state=np.array(self._states),
        )


def _clipped(boxes: list[tuple[float, float, float, float]], size: tuple[int, int]) -> Reals:
    """(N, 4) the parts of boxes within the picture; empty boxes where nothing is."""
    limits = np.array([size[0], size[1], size[0], size[1]], np.float64)
    return np.clip(np.array(boxes, np.float64).reshape(-1, 4), 0.0, limits)


def _ious(first: Reals, second: Reals) -> Reals:
    """(N, M) intersections over unions."""
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    shared = np.maximum(high - low, 0.0).prod(axis=2)
    areas = [np.maximum(boxes[:, 2:] - boxes[:, :2], 0.0).prod(axis=1) for boxes in (first, second)]
    union = areas[0][:, None] + areas[1][None, :] - shared
    return np.asarray(shared / np.maximum(union, 1e-9))
