"""Where the robot was, by commands and by odometry, and where a search makes it look."""

from __future__ import annotations

import math

import pytest

from heel.schemas import Odometry
from heel.services.commands.follow import _request
from heel.services.follower.own_motion import OwnMotion, Pose
from heel.services.follower.search import search_for


def odometry(linear_mps: float, angular_radps: float) -> Odometry:
    return Odometry(
        seq=0, x_m=0.0, y_m=0.0, heading_rad=0.0, linear_mps=linear_mps, angular_radps=angular_radps
    )


def driven(seconds: float, told: tuple[float, float], delay_s: float = 0.1) -> OwnMotion:
    """Told the same every 20 ms from time 0 on."""
    motion = OwnMotion(delay_s, 0.3)
    for step in range(round(seconds / 0.02) + 1):
        motion.advance(step * 0.02)
        motion.told(step * 0.02, *told)
    return motion


def test_commands_move_the_robot_after_its_delay() -> None:
    motion = driven(1.1, (1.0, 0.0), delay_s=0.1)
    assert motion.pose.x_m == pytest.approx(1.0, abs=0.03)
    assert motion.pose_soon().x_m == pytest.approx(1.1, abs=0.03)
    assert motion.pose_at(0.6).x_m == pytest.approx(0.5, abs=0.03)


def test_odometry_wins_while_it_is_fresh() -> None:
    motion = OwnMotion(0.0, 0.3)
    for step in range(51):
        now_s = step * 0.02
        if now_s <= 0.5:
            motion.odometry(odometry(0.0, 1.0), now_s)
        motion.advance(now_s)
        motion.told(now_s, 1.0, 0.0)
    assert motion.pose.heading_rad == pytest.approx(0.8, abs=0.03)
    assert math.hypot(motion.pose.x_m, motion.pose.y_m) == pytest.approx(0.2, abs=0.03)


def test_before_what_is_remembered_the_oldest_pose_counts_and_a_clock_never_runs_back() -> None:
    motion = driven(4.0, (1.0, 0.0))
    assert motion.pose_at(-5.0).x_m == pytest.approx(1.9, abs=0.05)
    before = motion.pose
    motion.advance(1.0)
    assert motion.pose == before


def test_a_place_is_seen_where_it_was_seen_from() -> None:
    pose = Pose(1.0, 2.0, 0.7)
    ahead, left = pose.seen(*pose.place(3.0, -0.4))
    assert (math.hypot(ahead, left), math.atan2(left, ahead)) == pytest.approx((3.0, -0.4))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_search_looks_there_then_to_both_sides_then_where_last_seen_and_ends(
    side: float,
) -> None:
    heading, looked = 0.0, []
    search = search_for(Pose(), (2.0, 2.0), (2.0, 1.0), side, 0.5)
    while not search.over:
        heading += min(max(search.bearing_rad(Pose(heading_rad=heading)), -0.02), 0.02)
        looked.append(heading)
        assert len(looked) < 1000
    there = math.pi / 4
    assert max(looked) == pytest.approx(there + 0.5, abs=0.1)
    assert min(looked[40:]) == pytest.approx(there - 0.5, abs=0.1)
    first, second = looked.index(max(looked)), 40 + looked[40:].index(min(looked[40:]))
    assert (first < second) == (side > 0)
    assert looked[-1] == pytest.approx(math.atan2(1.0, 2.0), abs=0.1)


def test_imprint_is_a_word_of_the_follow_command() -> None:
    assert _request(["imprint"]).mode == "imprint"
