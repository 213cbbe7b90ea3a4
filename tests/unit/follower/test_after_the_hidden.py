"""After a person whom a thing hides: along their way, for so long, and only where that is known."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest

from heel.schemas import (
    CameraMotion,
    MotionCommand,
    Odometry,
    Ranges,
    RangeSector,
    TargetRequest,
    Track,
    Tracks,
)
from heel.services.follower.core import Follower
from heel.services.follower.own_motion import Pose
from heel.services.follower.settings import FollowerSettings
from tests.unit.follower.people import TRACKER, person, tracks

STEP_S = 0.02
VANISHES_S = 8.0
TRAIL_S = 3.0
WALL_M = 1.0
"""Left of the robot's way there is a wall along it, up to the corner round which they go."""
CORNER_M = 6.0
BEHIND_M = 1.5
SECTOR_RAD = math.radians(5.0)
NOT_FROZEN = CameraMotion(affine=(1.01, 0.0, -3.2, 0.0, 1.01, -2.4), quality=1.0)
"""A picture that moves."""


def walk(t_s: float) -> tuple[float, float]:
    """Along the wall at 0.8 m/s, round its end, and back behind it."""
    way_m = 2.0 + 0.8 * t_s
    turn_m = CORNER_M + 0.6
    if way_m <= turn_m:
        return way_m, 0.0
    if way_m <= turn_m + BEHIND_M:
        return turn_m, way_m - turn_m
    return 2 * turn_m + BEHIND_M - way_m, BEHIND_M


def wall_m(pose: Pose, bearing_rad: float, most_m: float = 6.0) -> float:
    """How far it is to the wall in a direction."""
    angle_rad = pose.heading_rad + bearing_rad
    rise = math.sin(angle_rad)
    if rise <= 0.01:
        return most_m
    away_m = (WALL_M - pose.y_m) / rise
    at_m = pose.x_m + away_m * math.cos(angle_rad)
    return min(away_m, most_m) if away_m > 0 and at_m < CORNER_M else most_m


@dataclass
class Corner:
    """A robot that does at once as it is told, and a person who goes round a corner."""

    follower: Follower
    ranges: bool = True
    wall: Callable[[Pose, float], float] = wall_m
    seen: Callable[[float, float], bool] = lambda t_s, _bearing_rad: t_s < VANISHES_S
    unseen: tuple[Track, ...] = ()
    pose: Pose = field(default_factory=Pose)

    def run(self, seconds: float) -> list[tuple[float, MotionCommand]]:
        told = []
        linear_mps = angular_radps = 0.0
        for step in range(round(seconds / STEP_S)):
            t_s = step * STEP_S
            self.follower.observe_odometry(
                Odometry(seq=step, x_m=0.0, y_m=0.0, heading_rad=0.0, linear_mps=linear_mps,
                         angular_radps=angular_radps), t_s,
            )  # fmt: skip
            if self.ranges and step % 3 == 0:
                self.follower.observe_ranges(self._ranges(step), t_s)
            self.follower.observe(self._picture(t_s, step), TRACKER)
            if step == 0:
                self.follower.choose(TargetRequest(mode="id", track_id=1))
            command = self.follower.step(t_s, 0.0)
            linear_mps, angular_radps = command.linear_mps, command.angular_radps
            self.pose = self.pose.moved(linear_mps, angular_radps, STEP_S)
            told.append((t_s, command))
        return told

    def _picture(self, t_s: float, seq: int) -> Tracks:
        ahead_m, left_m = self.pose.seen(*walk(t_s))
        bearing_rad, away_m = math.atan2(left_m, ahead_m), math.hypot(ahead_m, left_m)
        seen = (person(1, distance_m=away_m, bearing_rad=bearing_rad),)
        people = seen if self.seen(t_s, bearing_rad) else self.unseen
        return tracks(*people, seq=seq).model_copy(update={"camera_motion": NOT_FROZEN})

    def _ranges(self, seq: int) -> Ranges:
        count = round(2 * math.pi / SECTOR_RAD)
        bearings = [math.remainder(k * SECTOR_RAD, 2 * math.pi) for k in range(count)]
        return Ranges(
            seq=seq,
            sectors=tuple(
                RangeSector(bearing_rad=bearing, width_rad=SECTOR_RAD,
                            distance_m=self.wall(self.pose, bearing))
                for bearing in bearings
            ),
        )  # fmt: skip


def nothing(_pose: Pose, _bearing_rad: float) -> float:
    """No wall at all."""
    return 6.0


def corner(trail_s: float = TRAIL_S) -> Corner:
    return Corner(Follower(FollowerSettings(trail_s=trail_s)))


def driven_unseen_m(told: list[tuple[float, MotionCommand]]) -> float:
    """How far it drives once nobody is seen for longer than people are coasted after."""
    return sum(c.linear_mps * STEP_S for t_s, c in told if t_s > VANISHES_S + 1.0)


def test_the_robot_drives_along_the_way_of_somebody_whom_a_wall_hides() -> None:
    robot = corner()
    told = robot.run(VANISHES_S + 2.0)
    going = [command for t_s, command in told if t_s > VANISHES_S + 0.1]
    assert going[30].state == "occluded"
    assert going[30].reason == "hidden behind a thing: along the way they took"
    assert driven_unseen_m(told) > 0.2
    assert max(command.linear_mps for command in going[60:]) <= 1.0
    assert robot.pose.x_m > CORNER_M, "round the end of the wall"


def test_without_the_setting_it_brakes_and_looks() -> None:
    told = corner(trail_s=0.0).run(VANISHES_S + 2.0)
    assert FollowerSettings().trail_s == 0.0
    assert driven_unseen_m(told) == 0.0
    assert told[-1][1].state == "searching"


def test_it_does_so_for_a_bounded_time_and_looks_round_then() -> None:
    told = corner(trail_s=1.4).run(VANISHES_S + 3.0)
    late = [command for t_s, command in told if t_s > VANISHES_S + 1.5]
    assert {command.state for command in late} <= {"searching", "lost"}
    assert {command.linear_mps for command in late} == {0.0}


@pytest.mark.parametrize(
    "robot",
    [
        pytest.param(replace(corner(), ranges=False), id="nothing tells what hides them"),
        pytest.param(replace(corner(), wall=nothing), id="nothing hides them"),
        pytest.param(
            replace(corner(), unseen=(person(1, state="occluded", occluded_by=(2,)), person(2))),
            id="somebody hides them",
        ),
    ],
)
def test_it_stays_where_they_may_be_back_at_once(robot: Corner) -> None:
    assert driven_unseen_m(robot.run(VANISHES_S + 2.5)) == pytest.approx(0.0, abs=0.02)


def test_what_has_come_between_since_may_be_them_and_is_not_driven_round() -> None:
    robot = replace(corner(), wall=nothing)
    robot.run(VANISHES_S)
    follower, start_s = robot.follower, VANISHES_S
    for step in range(100):
        t_s = start_s + step * STEP_S
        near = tuple(
            RangeSector(bearing_rad=0.1 * k, width_rad=0.1, distance_m=0.9) for k in range(-8, 9)
        )
        follower.observe_ranges(Ranges(seq=step, sectors=near), t_s)
        follower.observe(tracks(seq=1000 + step), TRACKER)
        command = follower.step(t_s, 0.0)
        assert "along the way" not in command.reason
    assert command.linear_mps == 0.0


def test_ranges_that_fall_silent_on_the_way_stop_it() -> None:
    robot = corner()
    robot.run(VANISHES_S + 0.8)
    for step in range(20):
        t_s = VANISHES_S + 0.8 + step * STEP_S
        robot.follower.observe(tracks(seq=2000 + step), TRACKER)
        command = robot.follower.step(t_s, 0.0)
    assert (command.state, command.linear_mps) == ("stopped", 0.0)
