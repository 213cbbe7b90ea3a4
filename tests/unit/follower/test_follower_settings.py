"""Every setting of the follower changes what the robot is told in the course of a script."""

from __future__ import annotations

import functools
import math
from typing import Any

import pytest

from heel.schemas import (
    Manual,
    MotionCommand,
    Odometry,
    Ranges,
    RangeSector,
    TargetRequest,
    Track,
)
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerSettings
from tests.unit.follower.people import TRACKER, person, tracks

STEP_S = 0.05
_SECONDS = 20.5

VALUES: dict[str, dict[str, Any]] = {
    "target": {"target": "nearest"},
    "ttl_s": {"ttl_s": 0.3},
    "max_tracks_age_s": {"max_tracks_age_s": 0.5},
    "max_ranges_age_s": {"max_ranges_age_s": 1.0},
    "min_identity_confidence": {"min_identity_confidence": 0.3},
    "resume_identity_confidence": {"resume_identity_confidence": 0.95},
    "min_identity_lead": {"min_identity_lead": 0.0},
    "resume_identity_lead": {"resume_identity_lead": 0.6},
    "confirm_s": {"confirm_s": 1.0},
    "coast_s": {"coast_s": 0.1},
    "hold_s": {"hold_s": 3.0},
    "ask_after_s": {"ask_after_s": 1.0},
    "trail_s": {"trail_s": 4.0},
    "search_s": {"search_s": 1.0},
    "search_radps": {"search_radps": 0.2},
    "imprint_s": {"target": "imprint", "imprint_s": 0.5},
    "distance_m": {"distance_m": 2.5},
    "personal_space_m": {"personal_space_m": 1.5},
    "person_height_m": {"person_height_m": 1.2},
    "horizontal_fov_deg": {"horizontal_fov_deg": 90.0},
    "linear_gain_per_s": {"linear_gain_per_s": 0.3},
    "angular_gain_per_s": {"angular_gain_per_s": 0.5},
    "max_linear_mps": {"max_linear_mps": 0.3},
    "max_reverse_mps": {"distance_m": 5.0, "max_reverse_mps": 0.5},
    "max_angular_radps": {"max_angular_radps": 0.1},
    "manual_linear_mps": {"manual_linear_mps": 0.2},
    "manual_angular_radps": {"manual_angular_radps": 0.2},
    "max_linear_mps2": {"max_linear_mps2": 0.2},
    "max_braking_mps2": {"max_braking_mps2": 0.5},
    "max_linear_mps3": {"max_linear_mps3": 0.5},
    "max_angular_radps2": {"max_angular_radps2": 0.2},
    "max_angular_radps3": {"max_angular_radps3": 0.5},
    "robot_delay_s": {"robot_delay_s": 0.6},
    "robot_radius_m": {"robot_radius_m": 0.6},
    "obstacle_margin_m": {"obstacle_margin_m": 0.6},
}
BY_WIRING = {"rate_hz": "services/follower/service.py paces its loop by it"}
BASE: dict[str, dict[str, Any]] = {
    "imprint_s": {"target": "imprint"}, "max_reverse_mps": {"distance_m": 5.0},
}  # fmt: skip
"""What a setting is compared with, where that is not the defaults."""


def _seen(t_s: float) -> tuple[Track, ...]:
    """Person 1 walks about, is doubted, hidden and gone; person 2 passes close by."""
    height = 110.0 + 45.0 * math.sin(0.9 * t_s)
    x = 320.0 + 150.0 * math.sin(0.7 * t_s)
    confidence, runner_up = 1.0, 0.0
    if 3.0 < t_s < 3.5:
        confidence = 0.5
    if 3.5 <= t_s < 4.2:
        confidence = 0.8
    if 4.8 < t_s < 5.3:
        confidence, runner_up = 0.75, 0.7
    if 5.3 <= t_s < 5.9:
        confidence, runner_up = 0.75, 0.4
    target = person(1, x, height, identity_confidence=confidence, runner_up_confidence=runner_up)
    other = person(2, 320.0, 330.0)
    if 6.4 < t_s < 6.9 or 8.0 < t_s < 9.2 or 17.0 < t_s < 20.4:
        return ()
    if 10.0 < t_s < 11.0:
        return (target, other)
    if 11.5 < t_s < 12.5:
        return (person(1, 330.0, 380.0),)
    return (target,)


def _ranges(seq: int, t_s: float) -> Ranges | None:
    """For three seconds a wall comes near, with a gap within."""
    if t_s < 13.0 or 14.0 < t_s < 14.4:
        return None
    wall_m = 2.5 - 1.3 * min(1.0, (t_s - 13.0) / 3.0)
    sectors = tuple(
        RangeSector(bearing_rad=0.5 * k, width_rad=0.5, distance_m=wall_m) for k in range(-2, 3)
    )
    return Ranges(seq=seq, sectors=sectors)


@functools.cache
def told(**settings: Any) -> tuple[MotionCommand, ...]:
    """Commands of the whole script."""
    follower = Follower(FollowerSettings.model_validate(settings))
    commands = []
    for step in range(round(_SECONDS / STEP_S)):
        t_s = step * STEP_S
        follower.observe(tracks(*_seen(t_s), seq=step), TRACKER)
        if step == 8 and "target" not in settings:
            follower.choose(TargetRequest(mode="id", track_id=1, tracker=TRACKER))
        ranges = _ranges(step, t_s)
        if ranges is not None:
            follower.observe_ranges(ranges, t_s)
        follower.observe_odometry(
            Odometry(seq=step, x_m=0.0, y_m=0.0, heading_rad=0.0, linear_mps=0.0,
                     angular_radps=0.0), t_s,
        )  # fmt: skip
        commands.append(follower.step(t_s, 0.3 if 2.0 < t_s < 2.4 else 0.05))
    return (*commands, *_by_hand(follower))


def _by_hand(follower: Follower) -> list[MotionCommand]:
    """In the end somebody takes the robot."""
    grant, commands = "0" * 16, []
    follower.take_by_hand(grant, "hand", _SECONDS)
    for step in range(20):
        t_s = _SECONDS + step * STEP_S
        wish = Manual(grant=grant, seq=step, held=True, forward=1.0, left=1.0, ttl_s=0.3)
        follower.observe_wish(wish, t_s, t_s)
        follower.observe_ranges(Ranges(seq=0, sectors=()), t_s)
        commands.append(follower.step(t_s, 0.05))
    return commands


def test_every_setting_is_looked_at() -> None:
    assert set(VALUES) | set(BY_WIRING) == set(FollowerSettings.model_fields)


@pytest.mark.parametrize("name", VALUES)
def test_a_setting_changes_what_the_robot_is_told(name: str) -> None:
    settings = VALUES[name]
    assert settings[name] != FollowerSettings.model_fields[name].default
    assert told(**settings) != told(**BASE.get(name, {}))


def test_the_script_goes_through_every_state() -> None:
    """A script in which the robot stands all the time would not notice much."""
    states = {command.state for command in told()}
    assert states >= {"acquiring", "following", "occluded", "unsure", "searching", "lost"}
