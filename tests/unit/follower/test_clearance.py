"""How far the way is free of things and of people."""

from __future__ import annotations

import math

import pytest

from heel.schemas import Ranges
from heel.schemas.robot import RangeSector
from heel.services.follower.clearance import (
    Body,
    Sectors,
    room_before_person_m,
    speed_to_stop_within_mps,
)
from heel.services.follower.settings import FollowerSettings
from heel.services.follower.surroundings import Surroundings

BODY = Body(radius_m=0.25, margin_m=0.15)


def ranges(*sectors: tuple[float, float, float]) -> Ranges:
    """Sectors of bearing, width and distance."""
    return Ranges(
        seq=0,
        sectors=tuple(
            RangeSector(bearing_rad=bearing, width_rad=width, distance_m=distance)
            for bearing, width, distance in sectors
        ),
    )


def lidar(wall: dict[int, float], farthest_m: float = 8.0) -> Ranges:
    """One sector a degree; what stands at which degree."""
    return ranges(
        *(
            (math.radians(degree), math.radians(1), wall.get(degree, farthest_m))
            for degree in range(-180, 180)
        )
    )


@pytest.mark.parametrize(
    ("seen", "bearing_rad", "range_m"),
    [
        (ranges((0.0, 0.2, 3.0), (0.2, 0.2, 1.0)), 0.04, 3.0),
        (ranges((0.0, 0.2, 3.0), (0.2, 0.2, 1.0)), 0.16, 1.0),
        (ranges((math.pi, 0.2, 2.0)), -math.pi + 0.05, 2.0),
        (ranges((0.0, 0.2, 3.0)), 0.3, None),
        (ranges(), 0.0, None),
    ],
    ids=["nearer the one", "nearer the other", "behind", "nobody looks there", "no sectors"],
)
def test_the_range_towards_a_direction_is_that_of_the_sector_that_looks_there(
    seen: Ranges, bearing_rad: float, range_m: float | None
) -> None:
    assert Sectors(seen).towards_m(bearing_rad) == range_m


@pytest.mark.parametrize(
    ("seen", "direction_rad", "free_m"),
    [
        (ranges((0.0, 0.5, 3.0)), 0.0, 2.6),
        (ranges((0.0, 0.5, 0.1)), 0.0, 0.0),
        (ranges((0.0, 0.5, 3.0), (0.0, 0.1, 2.0)), 0.0, 1.6),
        (ranges((0.4, 0.5, 3.0)), 0.0, None),
        (ranges((0.4, 0.5, 3.0)), 0.4, 2.6),
        (ranges((math.pi, 0.5, 1.0)), math.pi, 0.6),
        (ranges((0.0, 0.5, 3.0), (math.pi / 2, 0.5, 0.3)), 0.0, 2.6),
        (lidar({}), 0.0, 7.6),
        (lidar({10: 2.0}), 0.0, 1.97 - math.sqrt(0.4**2 - 0.33**2)),
        (lidar({20: 2.0}), 0.0, 7.6),
        (ranges(), 0.0, None),
    ],
    ids=["ahead", "touching", "nearest counts", "no sector ahead", "where it turns to", "behind",
         "beside", "open", "within the path", "beside the path", "no sectors"],
)  # fmt: skip
def test_the_way_is_free_as_far_as_the_nearest_thing_within_the_robots_width(
    seen: Ranges, direction_rad: float, free_m: float | None
) -> None:
    found = Sectors(seen).free_m(BODY, direction_rad)
    assert found == (None if free_m is None else pytest.approx(free_m, abs=0.01))


@pytest.mark.parametrize(
    ("place", "velocity", "room_m"),
    [
        ((3.0, 0.0), (0.0, 0.0), 2.0),
        ((0.8, 0.0), (0.0, 0.0), 0.0),
        ((-0.5, 0.0), (0.0, 0.0), math.inf),
        ((0.3, 0.8), (0.0, 0.0), math.inf),
        ((3.0, 1.2), (0.0, 0.0), math.inf),
        ((3.0, 0.6), (0.0, 0.0), 2.2),
        ((3.0, 0.0), (-1.0, 0.0), 1.0),
        ((3.0, 2.0), (0.0, -2.0), 2.0),
        ((3.0, 0.0), (1.2, 0.0), 2.0 + 1.2**2 / 6),
    ],
    ids=[
        "ahead",
        "too near",
        "behind",
        "beside",
        "aside",
        "half aside",
        "coming",
        "crossing",
        "walking off",
    ],
)
def test_room_ends_where_somebodys_personal_space_begins(
    place: tuple[float, float], velocity: tuple[float, float], room_m: float
) -> None:
    assert room_before_person_m(place, velocity, 1.0) == pytest.approx(room_m)


@pytest.mark.parametrize("delay_s", [0.0, 0.2])
@pytest.mark.parametrize("room_m", [0.0, 0.3, 2.0])
def test_the_speed_allowed_stops_within_the_room(room_m: float, delay_s: float) -> None:
    speed = speed_to_stop_within_mps(room_m, 1.5, delay_s)
    assert speed * delay_s + speed**2 / (2 * 1.5) == pytest.approx(room_m, abs=1e-9)
    assert speed_to_stop_within_mps(math.inf, 1.5, delay_s) == math.inf


def _detour_rad(wall: dict[int, float], bearing_rad: float = 0.0, way_m: float = 1.5) -> float:
    surroundings = Surroundings(FollowerSettings())
    surroundings.observe(Sectors(lidar(wall)), 0.0)
    return surroundings.detour_rad(bearing_rad, way_m, 0.6)


def test_a_door_post_before_the_person_is_passed_on_the_free_side() -> None:
    post = dict.fromkeys(range(5, 25), 1.0)
    assert -0.5 < _detour_rad(post) <= -0.3
    assert 0.3 <= _detour_rad({-degree: away for degree, away in post.items()}) < 0.5


def test_a_way_that_is_free_or_as_free_as_it_gets_is_not_left() -> None:
    assert _detour_rad({}) == 0.0
    assert _detour_rad(dict.fromkeys(range(-180, 180), 2.5)) == 0.0
    assert _detour_rad(dict.fromkeys(range(-60, 60), 1.0), way_m=0.0) == 0.0
    assert Surroundings(FollowerSettings()).detour_rad(0.0, 1.5, 0.6) == 0.0, "without ranges"
