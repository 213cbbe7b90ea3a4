"""People who bend, sit and fall, children and a table in the simulated world."""

from __future__ import annotations

import pytest

from heel.services.simulator.posture_scenarios import POSTURES
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.solids import Solids
from heel.services.simulator.state import CameraMount
from heel.services.simulator.views import look
from heel.services.simulator.world import World

LEAST_TALL = {
    "posture-bend": 0.62, "posture-tie": 0.55, "posture-crouch": 0.52, "posture-chair": 0.74,
    "posture-ground": 0.47, "posture-fall": 0.18, "table": 0.74,
}  # fmt: skip


def played(name: str, seed: int = 3) -> tuple[World, list[float], list[float]]:
    """The world at its end, and how tall and how fast its target was."""
    world = scenario(name, seed)
    tall, speed = [], []
    while not world.finished:
        world.step(0.1, 0.0, 0.0)
        tall.append(world.target.tall)
        speed.append(world.target.speed_mps)
    return world, tall, speed


@pytest.mark.parametrize("name", LEAST_TALL)
def test_the_target_gets_down_standing_and_walks_on_upright(name: str) -> None:
    _, tall, speed = played(name)
    assert min(tall) == pytest.approx(LEAST_TALL[name], abs=0.01)
    assert all(was > 0.8 for was, fast in zip(tall, speed, strict=True) if fast > 0.5)
    assert max(speed) > 0.5


def test_children_are_small_and_wheelchairs_roll() -> None:
    for seed in range(5):
        assert 0.9 <= scenario("child", seed).target.height_m <= 1.3
    _, tall, speed = played("wheelchair")
    assert max(tall) == min(tall) == pytest.approx(0.76)
    assert max(speed) > 0.5


@pytest.mark.parametrize("name", POSTURES)
def test_every_one_is_another_with_each_seed(name: str) -> None:
    first, second = scenario(name, 1), scenario(name, 2)
    assert first.scenario.name == name
    assert first.target != second.target


def test_boxes_show_the_posture() -> None:
    world, mount = scenario("posture-fall", 3), CameraMount()
    shares = []
    while not world.finished:
        world.step(0.1, 0.0, 0.0)
        sight = look(world, Solids(world.scenery.obstacles), mount)
        left, top, right, bottom = sight.box_xyxy[0].tolist()
        if sight.in_front[0]:
            shares.append((right - left) / (bottom - top))
    assert min(shares) < 0.5
    assert max(shares) > 2.0
