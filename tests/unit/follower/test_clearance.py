"""How far the way is free of things and of people."""

from __future__ import annotations

import math

import pytest

from heel.schemas import Ranges
from heel.schemas.robot import RangeSector
from heel.services.follower.clearance import (
    Body,
    Sectors,
    Watched,
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


def around(count: int, distance_m: float = 8.0, off: float = 0.0) -> list[RangeSector]:
    """Sectors that meet, the first one's middle so many widths left of ahead."""
    width = 2 * math.pi / count
    return [
        RangeSector(
            bearing_rad=math.remainder((k + off) * width, 2 * math.pi), width_rad=width,
            distance_m=distance_m,
        )
        for k in range(count)
    ]  # fmt: skip


def without_front(sectors: list[RangeSector], half_rad: float) -> Ranges:
    kept = [sector for sector in sectors if abs(sector.bearing_rad) > half_rad]
    return Ranges(seq=0, sectors=tuple(kept))


@pytest.mark.parametrize("count", [8, 36, 360, 720])
@pytest.mark.parametrize("distance_m", [0.4, 8.0])
def test_a_direction_that_is_left_out_after_it_was_measured_is_not_free(
    count: int, distance_m: float
) -> None:
    watched = Watched()
    front = around(count, distance_m)
    seen = Sectors(Ranges(seq=0, sectors=tuple(front)), watched)
    assert seen.room_m(BODY) == pytest.approx(distance_m - 0.4)
    for _ in range(3):
        blind = Sectors(without_front(front, 0.4), watched)
        assert blind.room_m(BODY) == blind.free_m(BODY) == 0.0
    back = Sectors(Ranges(seq=0, sectors=tuple(front)), watched)
    assert back.room_m(BODY) == pytest.approx(distance_m - 0.4)


def test_one_narrow_beam_that_is_left_out_is_as_free_as_its_neighbours() -> None:
    watched, beams = Watched(), around(360, 3.0)
    Sectors(Ranges(seq=0, sectors=tuple(beams)), watched)
    one_less = Ranges(seq=0, sectors=tuple(beams[1:]))
    assert Sectors(one_less, watched).room_m(BODY) == pytest.approx(2.6, abs=0.01)


def test_who_never_looked_ahead_says_nothing_about_it() -> None:
    watched = Watched()
    for _ in range(2):
        behind = Sectors(without_front(around(36), 2.0), watched)
        assert behind.free_m(BODY) is None
        assert behind.room_m(BODY) == math.inf


@pytest.mark.parametrize("count", [6, 7, 36, 72, 360, 720])
@pytest.mark.parametrize("turn", range(12))
def test_sectors_that_meet_ahead_leave_no_gap_by_rounding(count: int, turn: int) -> None:
    direction_rad = turn * 2 * math.pi / count
    seen = Sectors(Ranges(seq=0, sectors=tuple(around(count, 3.0, 0.5))))
    assert seen.free_m(BODY, direction_rad) is not None


def test_what_stands_beside_a_gap_between_sonars_is_in_the_way() -> None:
    sonars = ranges((0.25, 0.3, 0.5), (-0.25, 0.3, 4.0))
    assert Sectors(sonars).free_m(BODY) is None, "nothing looks there"
    assert Sectors(sonars).room_m(BODY) < 0.3
    far = ranges((0.25, 0.3, 4.0), (-0.25, 0.3, 4.0))
    assert Sectors(far).room_m(BODY) > 2.0


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
