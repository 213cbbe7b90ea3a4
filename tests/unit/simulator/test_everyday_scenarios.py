"""Everyday scenes: the person is out of view, met, hugged, seated, laden or pushed along."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from heel.services.simulator.everyday_scenarios import EVERYDAY
from heel.services.simulator.postures import SHAPES
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.solids import Solids
from heel.services.simulator.state import CameraMount, PersonState
from heel.services.simulator.views import look
from heel.services.simulator.walks import Leg
from heel.services.simulator.world import World
from tests.unit.simulator.empty_worlds import follow

SEEDS = range(4)


def played(name: str, seed: int, note: Callable[[World], float]) -> list[float]:
    """What is noted every 0.1 s while the robot stands where it was."""
    world = scenario(name, seed)
    notes = []
    while not world.finished:
        world.step(0.1, 0.0, 0.0)
        notes.append(note(world))
    return notes


def apart(one: PersonState, other: PersonState) -> float:
    return math.hypot(one.x_m - other.x_m, one.y_m - other.y_m)


def companion(world: World) -> PersonState:
    return next(person for person in world.people if person.role != "target")


def visible(world: World) -> list[float]:
    return look(world, Solids(world.scenery.obstacles), CameraMount()).visible.tolist()


@pytest.mark.parametrize("name", EVERYDAY)
@pytest.mark.parametrize("seed", SEEDS)
def test_the_same_seed_makes_the_same_episode_and_another_seed_another_one(
    name: str, seed: int
) -> None:
    assert scenario(name, seed).scenario == scenario(name, seed).scenario
    assert scenario(name, seed).scenario != scenario(name, seed + 1).scenario
    assert 30.0 <= scenario(name, seed).scenario.duration_s <= 60.0


@pytest.mark.parametrize("name", EVERYDAY)
@pytest.mark.parametrize("seed", SEEDS)
def test_no_way_of_the_target_leads_through_an_obstacle(name: str, seed: int) -> None:
    world = scenario(name, seed)
    solids = Solids(world.scenery.obstacles)
    person = world.scenario.people[0]
    place = np.array([person.x_m, person.y_m])
    for leg in person.walk.legs:
        assert isinstance(leg, Leg)
        step = np.array([leg.x_m, leg.y_m]) - place
        points = place + np.linspace(0.0, 1.0, 50)[:, None] * step
        assert solids.clearance(points)[0].min(initial=np.inf) > person.radius_m
        place = points[-1]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_person_that_enters_is_out_of_view_until_they_walk_off(seed: int) -> None:
    world = scenario("enters", seed)
    while world.t_s < 12.0:
        assert visible(world) == [0.0]
        world.step(0.1, 0.0, 0.0)


@pytest.mark.parametrize("seed", SEEDS[:2])
def test_twins_meet_where_a_robot_that_follows_sees_neither(seed: int) -> None:
    episode = follow("hidden-twin", seed)
    assert episode.longest_hidden_s > 2.5
    assert episode.world.contacts == 0
    together = played("hidden-twin", seed, lambda world: apart(*world.people))
    assert min(together) < 1.2
    assert together[-1] > 2.0


@pytest.mark.parametrize("seed", SEEDS)
def test_two_who_hug_touch_for_seconds_and_part(seed: int) -> None:
    gaps = np.array(played("hug", seed, lambda world: apart(*world.people)))
    assert 2.5 < 0.1 * (gaps < 0.62).sum() < 12.0
    assert gaps.min() >= 0.39
    assert gaps[-1] > 2.0


def test_a_seated_person_is_passed_and_stands_up_again() -> None:
    tall = played("sits", 2, lambda world: world.target.tall)
    assert min(tall) == pytest.approx(SHAPES["seated"].tall)
    assert tall[-1] == 1.0
    gap = min(played("sits", 2, lambda world: apart(*world.people)))
    assert 0.5 < gap < 1.2


@pytest.mark.parametrize("seed", SEEDS)
def test_a_wheelchair_is_pushed_by_somebody_right_behind_it(seed: int) -> None:
    def behind(world: World) -> float:
        target, other = world.target, companion(world)
        away = math.atan2(other.y_m - target.y_m, other.x_m - target.x_m)
        off = math.remainder(away - target.heading_rad - math.pi, 2 * math.pi)
        rolls = target.speed_mps > 0.4
        return float(apart(target, other) < 1.1 and abs(off) < 0.6) if rolls else math.nan

    told = np.array(played("pushed", seed, behind))
    assert np.nanmean(told[60:]) > 0.9
    assert scenario("pushed", seed).target.tall == SHAPES["in a wheelchair"].tall


def test_a_box_before_the_chest_shows_from_the_front_alone() -> None:
    assert scenario("carries-box", 1).target.carries
    assert not scenario("straight", 1).target.carries
