"""A range in somebody's direction makes their distance exact, where it can be theirs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from heel.schemas import Ranges
from heel.schemas.robot import RangeSector
from heel.services.follower.clearance import Sectors
from heel.services.follower.estimate import PlaceFilter
from heel.services.follower.own_motion import OwnMotion
from heel.services.follower.people_ranges import RangesInTime

SEEN_M, BODY_M = 2.0, 0.2


def ring(distances_m: dict[float, float], farthest_m: float = 6.0) -> Ranges:
    """36 sectors of 10 degrees; what some of them see, by bearing in degrees."""
    return Ranges(
        seq=0,
        sectors=tuple(
            RangeSector(
                bearing_rad=math.remainder(math.radians(degrees), 2 * math.pi),
                width_rad=math.radians(10),
                distance_m=distances_m.get(degrees, farthest_m),
            )
            for degrees in range(0, 360, 10)
        ),
    )


def sharpened(ranges: Ranges, range_age_s: float = 0.0, bearing_rad: float = 0.0) -> PlaceFilter:
    """Somebody seen 2 m away, 0.2 m wrong in every direction; the robot stands."""
    motion = OwnMotion(delay_s=0.1, odometry_age_s=0.3)
    motion.advance(1.0)
    where = SEEN_M * np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
    place = PlaceFilter(where, np.eye(2) * 0.2**2, 1.0)
    RangesInTime(Sectors(ranges), 1.0 - range_age_s).sharpen(place, 1.0, motion)
    return place


@pytest.mark.parametrize(
    ("seen", "age_s", "expected_m"),
    [
        pytest.param(ring({0: 1.6}), 0.0, 1.6 + BODY_M, id="nearer than the box says"),
        pytest.param(ring({0: 2.0}), 0.0, 2.0 + BODY_M, id="farther than the box says"),
        pytest.param(ring({0: 1.0}), 0.0, SEEN_M, id="somebody else in between"),
        pytest.param(ring({}), 0.0, SEEN_M, id="the sensor looks past"),
        pytest.param(ring({20: 1.6}), 0.0, SEEN_M, id="in another direction"),
        pytest.param(ring({0: 1.6}), 0.3, SEEN_M, id="too old"),
        pytest.param(Ranges(seq=0, sectors=()), 0.0, SEEN_M, id="no sectors"),
    ],
)
def test_a_range_corrects_the_distance_if_it_can_be_the_persons(
    seen: Ranges, age_s: float, expected_m: float
) -> None:
    x_m, y_m = sharpened(seen, age_s).place_at(1.0)

    assert (x_m, y_m) == (pytest.approx(expected_m, abs=0.03), pytest.approx(0.0, abs=1e-6))


def test_a_range_says_nothing_of_where_across_the_line_of_sight() -> None:
    bearing = math.radians(3)

    x_m, y_m = sharpened(ring({0: 1.6}), bearing_rad=bearing).place_at(1.0)

    assert math.atan2(y_m, x_m) == pytest.approx(bearing, abs=0.002)
    assert math.hypot(x_m, y_m) == pytest.approx(1.6 + BODY_M, abs=0.03)


@pytest.mark.parametrize(("width_deg", "told_m"), [(10, 1.6 + BODY_M), (40, None)])
def test_only_a_narrow_sector_tells_how_far_somebody_is(
    width_deg: float, told_m: float | None
) -> None:
    motion = OwnMotion(delay_s=0.1, odometry_age_s=0.3)
    motion.advance(1.0)
    place = PlaceFilter(np.array([SEEN_M, 0.0]), np.eye(2) * 0.2**2, 1.0)
    sector = RangeSector(bearing_rad=0.0, width_rad=math.radians(width_deg), distance_m=1.6)
    ranges = Ranges(seq=0, sectors=(sector,))
    assert RangesInTime(Sectors(ranges), 1.0).sharpen(place, 1.0, motion) == told_m
