"""What rays meet, how far the ring of ranges sees, and what a camera can see of whom."""

from __future__ import annotations

import math

import numpy as np
import pytest

from heel.services.simulator.sensors import RangeRing
from heel.services.simulator.solids import Solids, cast_at_discs
from heel.services.simulator.state import Obstacle, RobotState
from heel.services.simulator.world import World
from tests.unit.simulator.empty_worlds import MOUNT, actor, box, sight_of, world

ORIGIN = np.zeros(2)


@pytest.mark.parametrize(
    ("obstacle", "ray", "expected"),
    [
        (box(3.0, 0.0, 1.0, 1.0), (1.0, 0.0), (2.5, 3.5)),
        (box(3.0, 0.0, 1.0, 1.0), (2.0, 0.0), (1.25, 1.75)),
        (box(3.0, 0.0, 1.0, 1.0), (-1.0, 0.0), (math.inf, None)),
        (box(3.0, 0.0, 1.0, 1.0), (0.0, 1.0), (math.inf, None)),
        (box(3.0, 0.0, 2.0, 2.0, heading_rad=math.pi / 4), (1.0, 0.0), (3 - 2**0.5, 3 + 2**0.5)),
        (box(0.0, 0.0, 1.0, 1.0), (1.0, 0.0), (0.0, 0.5)),
    ],
)
def test_rays_enter_and_leave_boxes_where_geometry_says(
    obstacle: Obstacle, ray: tuple[float, float], expected: tuple[float, float | None]
) -> None:
    entry, leave = Solids((obstacle,)).cast(ORIGIN, np.array([ray]))
    assert entry[0, 0] == pytest.approx(expected[0])
    if expected[1] is not None:
        assert leave[0, 0] == pytest.approx(expected[1])


@pytest.mark.parametrize(
    ("centre", "ray", "expected"),
    [
        ((3.0, 0.0), (1.0, 0.0), 2.5),
        ((3.0, 0.0), (2.0, 0.0), 1.25),
        ((3.0, 0.3), (1.0, 0.0), 2.6),
        ((3.0, 0.6), (1.0, 0.0), math.inf),
        ((-3.0, 0.0), (1.0, 0.0), math.inf),
        ((0.1, 0.0), (1.0, 0.0), 0.0),
    ],
)
def test_rays_enter_discs_where_geometry_says(
    centre: tuple[float, float], ray: tuple[float, float], expected: float
) -> None:
    hit = cast_at_discs(ORIGIN, np.array([ray]), np.array([centre]), np.array([0.5]))
    assert hit[0, 0] == pytest.approx(expected)


def test_a_disc_in_a_wall_comes_out_by_the_shortest_way() -> None:
    solids = Solids((box(0.0, 0.0, 4.0, 0.2),))
    points = np.array([[0.5, 0.2], [0.5, -0.05], [5.0, 5.0], [2.3, 0.4]])
    moved, touched = solids.push_out(points, np.full(4, 0.25))
    assert touched.tolist() == [True, True, False, False]
    assert moved[:3] == pytest.approx(np.array([[0.5, 0.35], [0.5, -0.35], [5.0, 5.0]]))


def ranges_by_degree(it: World) -> dict[int, float]:
    message = it.ranges(0)
    return {round(math.degrees(s.bearing_rad)): s.distance_m for s in message.sectors}


def test_sectors_cover_the_whole_round_once() -> None:
    sectors = world().ranges(3).sectors
    assert len(sectors) == RangeRing.SECTORS
    assert sum(sector.width_rad for sector in sectors) == pytest.approx(2 * math.pi)
    assert {sector.distance_m for sector in sectors} == {RangeRing.MAX_M}


def test_a_wall_ahead_is_as_far_as_it_is_and_nothing_is_behind() -> None:
    seen = ranges_by_degree(world(obstacles=(box(2.1, 0.0, 0.2, 30.0),)))
    assert seen[0] == pytest.approx(2.0, abs=0.08)
    # The nearest ray of a sector is a third of its width off its middle.
    nearest_rad = math.radians(60 - 10 / 3)
    assert seen[60] == pytest.approx(2.0 / math.cos(nearest_rad), abs=0.15)
    assert seen[180] == seen[90] == RangeRing.MAX_M


def test_the_ring_turns_with_the_robot_and_sees_people() -> None:
    it = world(actor(0.0, 3.0), robot=RobotState(0.0, 0.0, math.pi / 2, 0.0, 0.0))
    seen = ranges_by_degree(it)
    assert seen[0] == pytest.approx(3.0 - 0.22, abs=0.12)
    assert seen[-90] == RangeRing.MAX_M


def test_a_box_in_the_picture_follows_the_pinhole() -> None:
    # All but 90 degrees over 640 pixels: 320 pixels of focal length, lens 0.8 m above the floor.
    sight = sight_of(world(actor(2.0, 0.5, height_m=1.8)))
    left, top, right, bottom = sight.box_xyxy[0].tolist()
    assert (left + right) / 2 == pytest.approx(320 - 320 * 0.5 / 2, rel=1e-4)
    assert top == pytest.approx(240 - 320 * 1.0 / 2, rel=1e-4)
    assert bottom == pytest.approx(240 + 320 * 0.8 / 2, rel=1e-4)
    assert right - left == pytest.approx(320 * 0.28 * 1.8 / 2, rel=1e-4)
    assert sight.visible[0] == 1.0


@pytest.mark.parametrize(
    ("place", "obstacles", "others", "visible"),
    [
        ((4.0, 0.0), (), (), (1.0, 1.0)),
        ((-4.0, 0.0), (), (), (0.0, 0.0)),
        ((2.0, 2.0), (), (), (0.3, 0.7)),  # on the picture's border
        ((4.0, 0.0), (box(2.0, 0.0, 0.2, 3.0),), (), (0.0, 0.0)),
        ((4.0, 0.0), (box(5.0, 0.0, 0.2, 3.0),), (), (1.0, 1.0)),  # behind the person
        ((4.0, 0.0), (box(2.0, 1.5, 0.2, 3.0),), (), (0.4, 0.6)),  # a wall's edge in the middle
        ((4.0, 0.0), (box(2.0, 0.0, 0.2, 3.0, 0.8),), (), (0.5, 0.6)),  # as high as the lens
        ((4.0, 0.0), (), ((2.0, 0.0),), (0.0, 0.1)),
        ((4.0, 0.0), (), ((2.0, 0.25),), (0.2, 0.9)),
        ((2.0, 0.0), (), ((4.0, 0.0),), (1.0, 1.0)),
    ],
)
def test_what_stands_before_somebody_hides_them(
    place: tuple[float, float],
    obstacles: tuple[Obstacle, ...],
    others: tuple[tuple[float, float], ...],
    visible: tuple[float, float],
) -> None:
    people = [actor(*place)] + [actor(*other, role="other") for other in others]
    sight = sight_of(world(*people, obstacles=obstacles))
    assert visible[0] <= sight.visible[0] <= visible[1]


def test_truth_has_no_box_for_who_is_behind_and_says_how_much_is_seen() -> None:
    it = world(actor(3.0, 0.0), actor(-3.0, 0.0, role="other"))
    truth = it.truth(7, MOUNT)
    assert truth.seq == 7
    assert [person.box_xyxy is None for person in truth.people] == [False, True]
    assert [person.visible for person in truth.people] == [1.0, 0.0]
