"""Every scenario does what its name says, and can be followed by sight alone."""

from __future__ import annotations

import colorsys
import functools
import itertools
import math

import numpy as np
import pytest

from heel.services.simulator.scenarios import SCENARIOS, scenario
from heel.services.simulator.solids import Solids
from heel.services.simulator.state import Outfit, RobotState
from heel.services.simulator.walks import Leg, Walk
from tests.unit.simulator.empty_worlds import Episode, actor, box, follow, world

NAMES = (
    "straight", "turns", "stop-and-go", "stands-still", "pillar", "doorway", "distractor-1",
    "distractor-2", "distractor-3", "distractor-4", "twin", "light-switch", "crowd", "drop-out",
)  # fmt: skip
SEED = 3


@functools.cache
def episode(name: str, seed: int = SEED) -> Episode:
    return follow(name, seed)


def test_the_names_are_those_agreed_on() -> None:
    assert tuple(SCENARIOS) == NAMES


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", range(8))
def test_the_target_begins_ahead_within_view_and_nobody_is_nearer(name: str, seed: int) -> None:
    it = scenario(name, seed)
    robot, target = it.robot, it.target
    away = math.hypot(target.x_m - robot.x_m, target.y_m - robot.y_m)
    bearing = math.atan2(target.y_m - robot.y_m, target.x_m - robot.x_m) - robot.heading_rad
    assert 2.0 <= away <= 3.5
    assert abs(math.remainder(bearing, 2 * math.pi)) < 0.3
    assert 30.0 <= it.scenario.duration_s <= 60.0
    assert it.scenario.people[target.id - 1].walk.speed_mps <= 1.3
    assert sum(person.role == "target" for person in it.people) == 1
    others = [p for p in it.people if p.role != "target"]
    assert all(math.hypot(p.x_m - robot.x_m, p.y_m - robot.y_m) > away + 1.0 for p in others)
    for one, other in itertools.combinations(it.people, 2):
        assert math.hypot(one.x_m - other.x_m, one.y_m - other.y_m) > 0.5
    x0, y0, x1, y1 = it.scenery.bounds_m
    assert all(x0 < p.x_m < x1 and y0 < p.y_m < y1 for p in (*it.people, robot))


@pytest.mark.parametrize("name", NAMES)
def test_who_keeps_one_and_a_half_metres_behind_ends_beside_the_target(name: str) -> None:
    seen = episode(name)
    assert seen.visible[0]
    assert seen.visible[-1]
    assert 1.0 < seen.distance_m[-1] < 2.0
    assert np.mean([1.0 <= d <= 2.0 for d in seen.distance_m]) > 0.6
    assert min(seen.distance_m) > 0.9
    assert seen.world.contacts == 0


@pytest.mark.parametrize("name", NAMES)
def test_the_target_stays_in_view_except_where_the_name_says_otherwise(name: str) -> None:
    hidden_s = episode(name).longest_hidden_s
    if name == "pillar":
        assert 3.0 <= hidden_s < 13.0
    elif name == "doorway":
        assert 10.0 <= hidden_s < 20.0
    elif name == "drop-out":
        assert 0.4 <= hidden_s <= 3.0
    else:
        assert hidden_s < 1.5


@pytest.mark.parametrize("name", NAMES)
def test_nobody_walks_through_walls(name: str) -> None:
    assert episode(name).deepest_in_wall_m < 1e-6


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", range(8))
def test_no_way_of_the_target_leads_through_an_obstacle(name: str, seed: int) -> None:
    it = scenario(name, seed)
    solids = Solids(it.scenery.obstacles)
    person = next(p for p in it.scenario.people if p.role == "target")
    place = np.array([person.x_m, person.y_m])
    for leg in person.walk.legs:
        step = np.array([leg.x_m, leg.y_m]) - place
        points = place + np.linspace(0.0, 1.0, 50)[:, None] * step
        assert solids.clearance(points)[0].min(initial=np.inf) > person.radius_m
        place = points[-1]


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_so_many_distractors_cross_between(count: int) -> None:
    assert len(episode(f"distractor-{count}").between) == count


def test_some_twin_crosses_between_and_all_twins_wear_the_same() -> None:
    for seed in range(6):
        it = scenario("twin", seed)
        target = it.target.outfit
        twins = [p for p in it.people if p.role == "twin"]
        assert len(twins) == 1
        assert _difference(twins[0].outfit, target) <= 3
        assert abs(twins[0].height_m - it.target.height_m) <= 0.03
    assert any(episode("twin", seed).between for seed in (SEED, SEED + 1))


def test_other_people_usually_wear_another_colour() -> None:
    apart = []
    for seed in range(20):
        people = scenario("crowd", seed).people
        hue = [colorsys.rgb_to_hsv(*(c / 255 for c in p.outfit.top))[0] for p in people]
        apart += [abs((h - hue[0] + 0.5) % 1.0 - 0.5) for h in hue[1:]]
    assert 0.6 < np.mean(np.array(apart) > 0.1) < 0.98


def test_the_target_stands_still_for_twenty_seconds() -> None:
    it = scenario("stands-still", SEED)
    longest = run = 0
    while not it.finished:
        it.step(0.1, 0.0, 0.0)
        run = run + 1 if it.target.speed_mps < 0.05 else 0
        longest = max(longest, run)
    assert 19.0 < longest * 0.1 < 24.0


def test_light_and_camera_change_when_the_name_says_so() -> None:
    for name in NAMES:
        script = scenario(name, SEED).scenario
        assert bool(script.lights) == (name == "light-switch")
        assert bool(script.dropouts) == (name == "drop-out")
    it = scenario("light-switch", SEED)
    levels = set()
    while not it.finished:
        it.step(0.1, 0.0, 0.0)
        levels.add(it.brightness)
    assert len(levels) == 2


def test_turns_turn_and_a_straight_way_does_not() -> None:
    turned = {name: _turned_rad(name) for name in ("straight", "turns")}
    assert turned["straight"] < 0.5
    assert turned["turns"] > 3.0


def test_a_crowd_is_a_crowd() -> None:
    for seed in range(6):
        assert len(scenario("crowd", seed).people) >= 7


def test_every_seed_makes_another_episode() -> None:
    starts = set()
    for seed in range(12):
        it = scenario("straight", seed)
        robot = it.robot
        starts.add((robot.x_m, robot.heading_rad, it.target.outfit.top, it.scenario.duration_s))
    assert len(starts) == 12


@pytest.mark.parametrize("name", ["crowd", "distractor-4", "doorway"])
def test_nobody_touches_a_robot_that_stands_in_the_way(name: str) -> None:
    for seed in range(4):
        it = scenario(name, seed)
        while not it.finished:
            it.step(0.1, 0.0, 0.0)
        assert it.contacts == 0


def test_walkers_keep_out_of_each_others_way() -> None:
    one = actor(-4.0, 0.0, Walk(1.2, (Leg(4.0, 0.0),)))
    other = actor(4.0, 0.0, Walk(1.2, (Leg(-4.0, 0.0),)), role="other", heading_rad=math.pi)
    it = world(one, other, robot=RobotState(0.0, 15.0, 0.0, 0.0, 0.0))
    nearest = math.inf
    for _ in range(500):
        it.step(0.02, 0.0, 0.0)
        first, second = it.people
        nearest = min(nearest, math.hypot(first.x_m - second.x_m, first.y_m - second.y_m))
    assert nearest >= 0.44 - 1e-9
    assert it.people[0].x_m > 3.7
    assert it.people[1].x_m < -3.7


def test_a_walker_turns_smoothly_and_faces_where_it_goes() -> None:
    it = world(actor(0.0, 0.0, Walk(1.2, (Leg(3.0, 0.0), Leg(3.0, 3.0)))))
    headings = [it.target.heading_rad]
    for _ in range(300):
        it.step(0.02, 0.0, 0.0)
        headings.append(it.target.heading_rad)
    assert np.abs(np.diff(headings)).max() <= 3.5 * 0.02 + 1e-9
    assert headings[-1] == pytest.approx(math.pi / 2, abs=0.3)
    assert it.target.stride_rad > 2 * math.pi * 3


def test_a_wall_in_the_way_stops_a_walker() -> None:
    it = world(actor(0.0, 5.0, Walk(1.2, (Leg(6.0, 5.0),))), obstacles=(box(3.0, 5.0, 0.2, 8.0),))
    for _ in range(600):
        it.step(0.02, 0.0, 0.0)
    assert it.target.x_m <= 2.9 - 0.22 + 1e-6


def _difference(first: Outfit, second: Outfit) -> int:
    return max(
        abs(a - b)
        for name in Outfit.__slots__
        for a, b in zip(getattr(first, name), getattr(second, name), strict=True)
    )


def _turned_rad(name: str) -> float:
    """How much the target's way turns at its corners altogether."""
    person = next(p for p in scenario(name, SEED).scenario.people if p.role == "target")
    way = [(person.x_m, person.y_m)]
    way += [(leg.x_m, leg.y_m) for leg in person.walk.legs if isinstance(leg, Leg)]
    steps = np.diff(np.array(way), axis=0)
    course = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return float(np.abs(np.diff(course)).sum())
