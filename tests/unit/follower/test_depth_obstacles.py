"""A robot with a depth camera and no scanner: it brakes for what stands in its way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from heel.schemas import Ranges, TargetRequest
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerSettings
from heel.services.geometry.depth import depth_sectors
from tests.unit.follower.people import TRACKER, person, tracks
from tests.unit.geometry.test_depth import CAMERA, SHAPE, empty, noisy, standing

FREE = noisy(empty())


def driven(depth_mm: np.ndarray, seconds: float = 2.0, until_s: float = math.inf) -> Follower:
    """A follower whose person is far away; depth shows the same until it stops coming."""
    made = Follower(FollowerSettings())
    seen = tracks(person(1, height=60.0))
    made.observe(seen, TRACKER)
    made.choose(TargetRequest(mode="id", track_id=1))
    for step in range(round(seconds / 0.02)):
        now_s = step * 0.02
        made.observe(seen, TRACKER)
        if step % 3 == 0 and now_s <= until_s:
            made.observe_ranges(Ranges(seq=step, sectors=depth_sectors(depth_mm, CAMERA)), now_s)
        made.step(now_s, 0.0)
    return made


def test_a_free_floor_is_driven_on() -> None:
    state = driven(FREE).state
    assert state.obstacle_watch
    assert state.state == "following"
    assert state.linear_mps > 0.8


@pytest.mark.parametrize("up_m", [(0.0, 0.5), (0.0, 1.2), (0.7, 0.8)])
def test_low_high_and_hanging_things_in_the_way_are_braked_for(up_m: tuple[float, float]) -> None:
    near = driven(noisy(standing(empty(), 0.75, (-0.5, 0.5), up_m))).state
    assert near.free_distance_m == pytest.approx(0.35, abs=0.08)
    assert near.linear_mps**2 / (2 * 2.5) <= (near.free_distance_m or 0.0)


def test_nothing_that_is_seen_is_touched() -> None:
    state = driven(noisy(standing(empty(), 0.4, (-0.5, 0.5), (0.0, 1.2)))).state
    assert state.linear_mps == 0.0


def test_a_thing_beside_the_way_is_not() -> None:
    beside = driven(noisy(standing(empty(), 1.5, (1.0, 1.4), (0.0, 1.2)))).state
    assert beside.linear_mps > 0.8


def test_a_covered_camera_and_one_half_covered_stop_the_robot() -> None:
    covered = driven(np.zeros(SHAPE, np.uint16)).state
    assert covered.linear_mps == 0.0
    assert "every sector is nan" in covered.reason
    half = FREE.copy()
    half[:, 100:220] = 0
    state = driven(half).state
    assert (state.linear_mps, state.free_distance_m) == (0.0, 0.0)


def test_depth_that_stops_coming_stops_the_robot() -> None:
    state = driven(FREE, seconds=3.0, until_s=1.5).state
    assert state.linear_mps == 0.0
    assert "range" in state.reason
