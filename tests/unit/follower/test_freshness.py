"""Low frame rates: the robot stands and says which rate is needed, it does not stutter."""

from __future__ import annotations

import math
import re
from itertools import pairwise

import pytest

from heel.services.follower.core import Follower
from heel.services.follower.freshness import Freshness
from heel.services.follower.settings import FollowerSettings
from tests.unit.follower.people import TRACKER, person, tracks

STEP_S = 0.02


def states(fps: float, late_s: float, seconds: float = 12.0) -> list[tuple[str, str]]:
    """State and reason of every step with somebody in sight who walks about."""
    follower = Follower(FollowerSettings(target="nearest"))
    due_s, newest_s = 0.0, None
    coming: list[float] = []
    told: list[tuple[str, str]] = []
    for step in range(round(seconds / STEP_S)):
        now_s = step * STEP_S
        if now_s >= due_s - 1e-9:
            coming.append(now_s)
            due_s += 1 / fps
        while coming and coming[0] + late_s <= now_s + 1e-9:
            newest_s = coming.pop(0)
            seq = round(newest_s * 1000)
            walker = person(1, x=300 + 40 * math.sin(3 * now_s), height=120)
            follower.observe(tracks(walker, seq=seq), TRACKER)
        command = follower.step(now_s, None if newest_s is None else now_s - newest_s)
        told.append((command.state, command.reason))
    return told


@pytest.mark.parametrize(
    ("fps", "late_s", "words"),
    [
        (7.5, 0.12, r"camera gives 7\.\d frames/s 0\.12 s late, at least 10 are needed"),
        (5.0, 0.06, "camera gives 5 frames/s 0.06 s late, at least 7 are needed"),
        (2.0, 0.06, "camera gives 2 frames/s 0.06 s late, at least 7 are needed"),
        (20.0, 0.3, "they come 0.3 s late"),
    ],
)
def test_too_few_frames_stand_still_with_the_reason(fps: float, late_s: float, words: str) -> None:
    told = states(fps, late_s)
    changes = sum(before != now for before, now in pairwise(told))
    assert changes <= 8
    assert {state for state, _ in told[-400:]} == {"lost"}
    assert re.fullmatch(f"tracks are older than 0.22 s: {words}", told[-1][1])


@pytest.mark.parametrize(("fps", "late_s"), [(15.0, 0.12), (10.0, 0.06), (7.5, 0.06)])
def test_enough_frames_are_followed_by(fps: float, late_s: float) -> None:
    told = states(fps, late_s)
    assert {state for state, _ in told[-400:]} == {"following"}


def test_tracks_count_again_once_they_are_fresh_for_longer_than_one_frame_can_be() -> None:
    freshness = Freshness(0.2, 0.1)
    assert freshness.judge(1.0, 0.1) is None
    assert freshness.judge(2.0, 0.21) is not None
    assert freshness.judge(2.19, 0.1) is not None
    assert freshness.judge(2.21, 0.1) is None
    assert freshness.judge(3.0, 0.21) is not None, "again: twice as long"
    assert freshness.judge(3.39, 0.1) is not None
    assert freshness.judge(3.41, 0.1) is None
    assert freshness.judge(30.0, float("nan")) == "tracks are older than 0.2 s"
    assert freshness.judge(30.21, 0.1) is None, "long ago is forgotten"


def test_a_camera_that_falls_silent_has_no_low_rate() -> None:
    freshness = Freshness(0.2, 0.1)
    for frame in range(10):
        freshness.frame(frame * 0.04, 0.05)
    assert freshness.judge(2.0, 1.6) == "tracks are older than 0.2 s"
