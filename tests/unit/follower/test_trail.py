"""Along the way that a person took, where the straight way to them is blocked."""

from __future__ import annotations

import math

import pytest

from heel.services.follower.own_motion import Pose
from heel.services.follower.trail import Trail


def corner() -> Trail:
    """Three metres straight on, then three to the left."""
    trail = Trail()
    for step in range(31):
        trail.add((0.1 * step, 0.0))
    for step in range(1, 31):
        trail.add((3.0, 0.1 * step))
    return trail


def anywhere(_bearing_rad: float, _way_m: float) -> bool:
    return True


def nowhere(_bearing_rad: float, _way_m: float) -> bool:
    return False


def straight_on(bearing_rad: float, _way_m: float) -> bool:
    """A wall to the left, along the first three metres."""
    return abs(bearing_rad) < 0.2


def test_there_is_no_way_after_nobody() -> None:
    assert Trail().way(Pose(), anywhere) is None


def test_where_nothing_is_in_the_way_it_leads_straight_to_the_end() -> None:
    way = corner().way(Pose(), anywhere)
    assert way is not None
    assert way.bearing_rad == pytest.approx(math.pi / 4)
    assert way.left_m == pytest.approx(way.aim_m) == pytest.approx(3.0 * math.sqrt(2.0))


def test_round_a_corner_it_leads_along_the_places_as_far_as_is_free() -> None:
    way = corner().way(Pose(), straight_on)
    assert way is not None
    assert 0.1 < way.bearing_rad < 0.2
    assert way.aim_m == pytest.approx(3.0, abs=0.1)
    assert way.left_m == pytest.approx(5.5, abs=0.3)


def test_where_no_place_is_free_it_leads_to_the_next_one() -> None:
    way = corner().way(Pose(), nowhere)
    assert way is not None
    assert way.bearing_rad == 0.0
    assert way.aim_m == pytest.approx(0.45, abs=0.1)
    assert way.left_m == pytest.approx(6.0, abs=0.2)


def test_what_the_robot_has_passed_is_no_way_on() -> None:
    way = corner().way(Pose(3.0, 1.0, math.pi / 2), nowhere)
    assert way is not None
    assert abs(way.bearing_rad) < 0.1
    assert way.left_m == pytest.approx(2.0, abs=0.2)


def test_at_its_end_there_is_no_way_on() -> None:
    assert corner().way(Pose(3.0, 2.9, 0.0), anywhere) is None


def test_it_is_told_from_where_the_robot_is_and_looks() -> None:
    way = corner().way(Pose(1.0, 0.0, math.pi / 2), anywhere)
    assert way is not None
    assert way.bearing_rad == pytest.approx(math.atan2(3.0, 2.0) - math.pi / 2)


def test_who_was_out_of_sight_begins_another_way() -> None:
    trail = corner()
    trail.add((8.0, 3.0))
    way = trail.way(Pose(), nowhere)
    assert way is not None
    assert way.left_m == pytest.approx(math.hypot(8.0, 3.0))


def test_of_a_long_way_only_the_newest_part_is_kept() -> None:
    trail = Trail()
    for step in range(2000):
        trail.add((0.1 * step, 0.0))
    way = trail.way(Pose(150.0, 0.0, 0.0), nowhere)
    assert way is not None
    assert way.aim_m > 30.0


def test_of_another_person_nothing_is_kept() -> None:
    trail = corner()
    trail.clear()
    assert trail.way(Pose(), anywhere) is None
