"""The control law in a small closed loop with latency, inertia and noise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import pytest

from heel.schemas import Ranges, TargetRequest
from heel.schemas.robot import RangeSector
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerSettings
from tests.unit.follower.people import TRACKER, person, tracks
from tests.unit.follower.walking_world import Sample, Walk, World


def straight(speed_mps: float = 1.4, start_m: float = 3.0, from_s: float = 1.0,
             to_s: float = math.inf) -> Walk:  # fmt: skip
    """Straight away from the robot; stops as a person does, within 0.4 s."""

    def walk(t_s: float) -> tuple[float, float]:
        walked = max(0.0, min(t_s, to_s) - from_s) * speed_mps
        ending = min(max(t_s - to_s, 0.0), 0.4)
        return start_m + walked + speed_mps * ending * (1 - ending / 0.8), 0.0

    return walk


def circle(t_s: float) -> tuple[float, float]:
    return 3 + 4 * math.sin(0.3 * t_s), 4 - 4 * math.cos(0.3 * t_s)


def zigzag(t_s: float) -> tuple[float, float]:
    return 3 + 1.0 * t_s, 1.5 * math.sin(0.8 * t_s)


def stands_aside(t_s: float) -> tuple[float, float]:
    return 2.0 * math.cos(0.6), 2.0 * math.sin(0.6)


def world(walks: Mapping[int, Walk], odometry: bool = False, **changes: Any) -> World:
    settings = changes.pop("settings", {})
    return World(walks, Follower(FollowerSettings(**settings)), odometry=odometry, **changes)


def kept_up(samples: list[Sample], from_s: float = 5.0) -> float:
    """Share of time within 1 to 2 m and facing, as Habitat's F counts it."""
    late = [sample for sample in samples if sample.t_s >= from_s]
    good = [s for s in late if 1 <= s.distance_m <= 2 and abs(s.bearing_rad) < math.pi / 4]
    return len(good) / len(late)


@pytest.mark.parametrize("odometry", [False, True], ids=["commands", "odometry"])
@pytest.mark.parametrize("walk", [straight(), circle, zigzag], ids=["straight", "circle", "zigzag"])
def test_somebody_who_walks_is_kept_up_with(walk: Walk, odometry: bool) -> None:
    samples = world({1: walk}, odometry).run(15.0)
    assert kept_up(samples) > 0.95
    assert all(sample.command.state == "following" for sample in samples if sample.t_s > 1)


@pytest.mark.parametrize("latency_s", [0.02, 0.06, 0.12])
@pytest.mark.parametrize("odometry", [False, True], ids=["commands", "odometry"])
def test_turning_to_somebody_does_not_swing(latency_s: float, odometry: bool) -> None:
    """80 ms from a command to the wheels and up to 120 ms from picture to tracks."""
    samples = world(
        {1: stands_aside}, odometry, latency_s=latency_s, command_s=0.08, noise_px=0.5
    ).run(4.0)  # fmt: skip
    bearings = [sample.bearing_rad for sample in samples]
    assert abs(bearings[-1]) < 0.05
    assert min(bearings) > -0.06, "overshoot"
    turns = [sample.command.angular_radps for sample in samples]
    assert sum(a * b < 0 for a, b in pairwise(turns)) <= 1


@pytest.mark.parametrize("command_s", [0.2, 0.4])
def test_a_robot_that_is_slower_than_assumed_soon_swings_no_more(command_s: float) -> None:
    swinging = world({1: stands_aside}, command_s=command_s)
    samples = swinging.run(25.0)
    late = [sample for sample in samples if sample.t_s > 15.0]
    assert max(abs(sample.bearing_rad) for sample in late) < 0.1
    assert max(abs(sample.command.angular_radps) for sample in late) < 0.3


def test_that_it_swings_is_said_and_what_helps() -> None:
    slow = world({1: stands_aside}, command_s=0.4)
    slow.run(10.0)
    assert "measure that, or publish robot/odometry" in (slow.follower.swings or "")


@pytest.mark.parametrize("odometry", [False, True])
@pytest.mark.parametrize("walk", [circle, zigzag])
def test_who_walks_about_is_not_taken_for_a_swing(walk: Walk, odometry: bool) -> None:
    made = world({1: walk}, odometry)
    made.run(30.0)
    assert made.follower.swings is None


@pytest.mark.parametrize("height_m", [1.55, 1.7, 1.9])
def test_personal_space_is_kept_when_the_person_stops(height_m: float) -> None:
    samples = world({1: straight(to_s=8.0)}, height_m=height_m).run(14.0)
    assert min(sample.distance_m for sample in samples) > 1.0
    assert samples[-1].command.linear_mps == pytest.approx(0.0, abs=0.01)


def test_noise_of_boxes_does_not_become_motion() -> None:
    samples = world({1: lambda t: (1.55, 0.0)}, noise_px=3.0).run(6.0)
    late = [sample.command for sample in samples if sample.t_s > 1]
    assert max(abs(command.linear_mps) for command in late) < 0.15
    assert max(abs(command.angular_radps) for command in late) < 0.1


def test_personal_space_of_others_is_kept_too() -> None:
    """Somebody stands beside the way that the target has taken."""
    samples = world({1: straight(), 2: lambda t: (6.0, 0.5)}).run(12.0)
    assert min(sample.nearest_m for sample in samples) > 1.0


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["left", "right"])
@pytest.mark.parametrize("speed_mps", [0.0, -1.0], ids=["standing", "oncoming"])
def test_who_is_beside_the_way_is_passed_with_space(side: float, speed_mps: float) -> None:
    def beside(t_s: float) -> tuple[float, float]:
        return 8.0 + speed_mps * t_s, 0.8 * side

    samples = world({1: straight(1.0), 2: beside}).run(20.0)
    assert min(sample.nearest_m for sample in samples) > 0.95
    assert kept_up(samples, 16.0) > 0.9


def test_who_crosses_makes_the_robot_wait_and_then_it_goes_on() -> None:
    def crossing(t_s: float) -> tuple[float, float]:
        return 6.0, 3.0 - 1.0 * max(0.0, t_s - 2.0)

    samples = world({1: straight(1.0, 4.0), 2: crossing}).run(22.0)
    assert min(sample.nearest_m for sample in samples) > 0.8
    assert kept_up(samples, 18.0) > 0.9


def test_a_short_gap_is_bridged_and_a_long_one_is_searched_and_the_same_person_taken_back() -> None:
    def hidden(number: int, t_s: float) -> bool:
        return 4.0 < t_s < 4.4 or 8.0 < t_s < 12.0

    def stops(t_s: float) -> tuple[float, float]:
        return straight(0.8, to_s=7.5)(t_s)

    samples = world({1: stops}, hidden=hidden).run(16.0)
    states = {round(s.t_s, 2): s.command.state for s in samples}
    assert states[4.3] == "occluded"
    assert states[6.0] == "following"
    assert states[10.0] in ("searching", "lost")
    assert states[14.0] == "following"
    blind = [s.command for s in samples if 9.2 < s.t_s < 12.0]
    assert all(command.linear_mps == 0 for command in blind)


def test_who_walks_out_of_the_picture_is_turned_after() -> None:
    """To the left, faster than the robot turns: it ends up looking where the person went."""

    def leaves(t_s: float) -> tuple[float, float]:
        return 2.0, min(3.0 * max(0.0, t_s - 2.0), 4.0)

    samples = world({1: leaves}, settings={"max_angular_radps": 0.5}).run(12.0)
    assert samples[-1].command.state == "following"
    assert abs(samples[-1].bearing_rad) < 0.15


def sector(distance_m: float, bearing_rad: float = 0.0) -> Ranges:
    return Ranges(
        seq=0, sectors=(RangeSector(bearing_rad=bearing_rad, width_rad=1.0, distance_m=distance_m),)
    )


def driven(ranges: Ranges | None, every_s: float = 0.1, seconds: float = 3.0) -> Follower:
    """A follower whose person is far away, with a sensor that sees the same all the time."""
    made = Follower(FollowerSettings())
    seen = tracks(person(1, height=60.0))
    made.observe(seen, TRACKER)
    made.choose(TargetRequest(mode="id", track_id=1))
    due_s = 0.0
    for step in range(round(seconds / 0.02)):
        now_s = step * 0.02
        made.observe(seen, TRACKER)
        if ranges is not None and now_s >= due_s:
            made.observe_ranges(ranges, now_s)
            due_s += every_s
        made.step(now_s, 0.0)
    return made


def test_without_ranges_nothing_looks_out_and_the_state_says_so() -> None:
    state = driven(None).state
    assert (state.obstacle_watch, state.free_distance_m) == (False, None)
    assert state.linear_mps > 1


@pytest.mark.parametrize(("distance_m", "moves"), [(5.0, True), (1.0, True), (0.4, False)])
def test_speed_is_capped_by_the_free_distance(distance_m: float, moves: bool) -> None:
    state = driven(sector(distance_m)).state
    assert (state.obstacle_watch, state.state) == (True, "following")
    assert state.free_distance_m == pytest.approx(max(0.0, distance_m - 0.4))
    assert (state.linear_mps > 0) == moves
    assert state.linear_mps**2 / (2 * 2.5) <= max(0.0, distance_m - 0.4)


def test_a_sensor_that_does_not_look_ahead_is_no_watch() -> None:
    state = driven(sector(0.3, bearing_rad=2.5)).state
    assert (state.obstacle_watch, state.free_distance_m) == (False, None)
    assert state.linear_mps > 1


def test_something_that_appears_too_near_to_brake_for_stops_the_robot_at_once() -> None:
    made = driven(sector(5.0))
    assert made.state.linear_mps > 1
    made.observe_ranges(sector(0.6), 3.0)
    assert made.step(3.0, 0.0).linear_mps == 0.0


@pytest.mark.parametrize(
    ("range_m", "bearing_rad", "drives"),
    [
        pytest.param(5.0, 0.0, True, id="nothing nearer"),
        pytest.param(1.0, 0.0, False, id="something in their direction"),
        pytest.param(1.0, 1.0, True, id="something aside"),
    ],
)
def test_out_of_sight_the_target_may_be_what_stands_in_their_direction(
    range_m: float, bearing_rad: float, drives: bool
) -> None:
    made = driven(sector(5.0))
    for step in range(20):
        made.observe(tracks(), TRACKER)
        # What looked ahead goes on to: left out it would be a sensor that has failed there.
        ahead = sector(5.0).sectors if bearing_rad else ()
        seen = (*ahead, *sector(range_m, bearing_rad).sectors)
        made.observe_ranges(Ranges(seq=0, sectors=seen), 3.0 + step * 0.02)
        command = made.step(3.0 + step * 0.02, 0.0)
    assert command.state == "occluded"
    assert (command.linear_mps > 0) == drives


def test_a_robot_that_stood_before_a_wall_does_not_set_off_when_it_is_left_out() -> None:
    """As by a driver that drops beams which fail, or show something too near."""
    made = driven(sector(0.4))
    assert made.state.linear_mps == 0.0
    for step in range(50):
        made.observe(tracks(person(1)), TRACKER)
        made.observe_ranges(sector(0.5, bearing_rad=2.5), 3.0 + step * 0.02)
        assert made.step(3.0 + step * 0.02, 0.0).linear_mps == 0.0
    assert made.state.free_distance_m == 0.0


def test_ranges_that_were_there_once_and_end_stop_the_robot_with_the_reason() -> None:
    made = driven(sector(5.0), every_s=10.0)
    assert (made.state.state, made.state.reason) == ("stopped", "ranges are older than 0.25 s")
    assert (made.state.linear_mps, made.state.angular_radps) == (0.0, 0.0)
    assert made.state.obstacle_watch is False


def test_who_may_reverse_does_not_back_into_what_is_behind_or_unseen() -> None:
    near = tracks(person(1, distance_m=1.1, bearing_rad=0.0))
    for behind, backs in ((None, True), (sector(3.0), False), (sector(3.0, math.pi), True),
                          (sector(0.3, math.pi), False)):  # fmt: skip
        made = Follower(FollowerSettings(max_reverse_mps=0.3))
        made.observe(near, TRACKER)
        made.choose(TargetRequest(mode="id", track_id=1))
        for step in range(60):
            made.observe(near, TRACKER)
            if behind is not None:
                made.observe_ranges(behind, step * 0.02)
            command = made.step(step * 0.02, 0.0)
        assert (command.linear_mps < 0) == backs
