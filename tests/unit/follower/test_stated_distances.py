"""Distances, speeds and times that people near the robot count on, one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from heel.schemas import CameraMotion
from heel.services.follower.clearance import Room, Sectors
from heel.services.follower.controller import Goal, VelocityController
from heel.services.follower.estimate import PlaceFilter
from heel.services.follower.moving_picture import PictureWatch
from heel.services.follower.own_motion import Pose
from heel.services.follower.settings import FollowerSettings
from heel.services.follower.surroundings import Surroundings
from tests.unit.follower.people import person, tracks
from tests.unit.follower.test_follower_parts_pinned import among, lidar, somebody

SETTINGS = FollowerSettings()
STAND_M = 3.0


def room_m(followed: bool, ahead_m: float = STAND_M, least_share: float = 1.0) -> float:
    """How far the robot may go before somebody that stands there."""
    one = somebody(1, (ahead_m, 0.0), least_share=least_share)
    surroundings = Surroundings(SETTINGS)
    return surroundings.room(
        among(one), 1 if followed else 2, Pose(), 1.0, 0.0, 0.0, True
    ).ahead_m  # fmt: skip


def test_personal_space_is_kept_with_a_quarter_of_a_metre_for_the_one_that_is_followed() -> None:
    space_m = SETTINGS.personal_space_m
    assert STAND_M - room_m(followed=True) == pytest.approx(space_m + 0.25, abs=0.02)
    assert STAND_M - room_m(followed=False) == pytest.approx(space_m + 0.2, abs=0.02)
    assert room_m(followed=True, ahead_m=1.2) == 0.0


def test_from_the_child_that_an_adult_may_be_nine_tenths_of_personal_space_are_kept() -> None:
    """A child of 0.9 m that is taken for 1.7 m is at 0.53 of the distance."""
    share = 0.9 / SETTINGS.person_height_m
    kept_m = 6.0 * share - room_m(followed=True, ahead_m=6.0, least_share=share)
    assert kept_m == pytest.approx(0.9 * SETTINGS.personal_space_m, abs=0.02)
    assert room_m(followed=True, ahead_m=6.0) > room_m(True, 6.0, least_share=share)


def test_out_of_sight_whatever_ranges_show_towards_the_person_is_kept_from() -> None:
    surroundings = Surroundings(SETTINGS)
    surroundings.observe(Sectors(lidar({0: 1.5})), 1.0)
    hidden = surroundings.room(among(somebody(1, (3.0, 0.0))), 1, Pose(), 1.0, 0.0, 0.0, False)
    body_m = 1.5 + 0.2
    assert hidden.ahead_m == pytest.approx(body_m - SETTINGS.personal_space_m - 0.25, abs=0.02)


def test_the_speed_lets_the_robot_stop_in_its_room_with_seven_tenths_of_its_brakes() -> None:
    """In the worst order: it learns of the room late, twice its delay, and then brakes."""
    for free_m in (0.2, 0.5, 1.0, 2.0):
        controller = VelocityController(SETTINGS)
        speed_mps = 0.0
        for _ in range(200):
            room = Room(free_m, math.inf, "a wall")
            speed_mps, _ = controller.follow(Goal((9.0, 0.0), (1.5, 0.0)), room, 0.0, 0.05)
        late_s = 2 * SETTINGS.robot_delay_s + 0.1
        needs_m = speed_mps * late_s + speed_mps**2 / (2 * 0.7 * SETTINGS.max_braking_mps2)
        assert needs_m <= free_m + 0.01
        assert needs_m >= min(0.9 * free_m, 0.3) or speed_mps == SETTINGS.max_linear_mps


def test_no_person_is_expected_to_walk_faster_than_a_jog_or_on_for_more_than_a_second() -> None:
    made = PlaceFilter(np.array([2.0, 0.0]), np.eye(2) * 1e-3, 0.0)
    for step in range(1, 40):
        made.update(np.array([2.0 + 0.2 * step, 0.0]), np.eye(2) * 1e-3, 0.05 * step)
    assert math.hypot(*made.velocity) == pytest.approx(2.5, abs=0.01), "seen at 4 m/s"
    now_m = made.place_at(39 * 0.05)[0]
    assert made.place_at(39 * 0.05 + 5.0)[0] - now_m == pytest.approx(2.5, abs=0.01)


@pytest.mark.parametrize(("linear_mps", "angular_radps"), [(0.5, 0.0), (0.0, 0.2)])
def test_a_picture_that_stands_still_is_frozen_after_half_a_metre_or_seven_degrees(
    linear_mps: float, angular_radps: float
) -> None:
    watch, pose, still = PictureWatch(), Pose(), person(1, height=300.0)
    for step in range(200):
        pose = pose.moved(linear_mps, angular_radps, 0.05)
        motion = CameraMotion(affine=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0), quality=1.0)
        frame = tracks(still, seq=step).model_copy(update={"camera_motion": motion})
        watch.frame(frame, 0.05 * step, still, 2.0, pose)
        if watch.frozen:
            break
    gone = (pose.x_m - 0.025, pose.heading_rad - 0.01)
    assert 0.5 <= gone[0] < 0.56 or 0.12 <= gone[1] < 0.14
