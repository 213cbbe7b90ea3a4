from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("panda3d", reason="the extra sim is not installed")

from heel.services.runtime.process import memory_mb
from heel.services.simulator.render.clothes import weaves_of
from heel.services.simulator.render.effects import CameraEffects
from heel.services.simulator.render.renderer import Renderer
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.state import CameraMount, Floor, Obstacle, RobotState, Scenery
from tests.unit.simulator.drawn_world import MEADOW, OUTFIT, ROOM, StillWorld, person

MOUNT = CameraMount(width_px=320, height_px=240)
PERFECT = CameraEffects(noise_grey=0, shutter_s=0, exposure_lag_s=0)
CROWD = tuple(person(3 + i, i - 2.0, i, 1.0, i * 0.7, number=i + 1) for i in range(4))


def drawn(world: StillWorld, seed: int = 5, effects: CameraEffects | None = None
          ) -> NDArray[np.uint8]:  # fmt: skip
    with Renderer(world.scenery, MOUNT, effects, seed) as renderer:
        return renderer.draw(world)


@pytest.mark.parametrize("scenery", [MEADOW, ROOM])
def test_equal_worlds_give_equal_pixels(scenery: Scenery) -> None:
    world = StillWorld(CROWD, scenery, RobotState(0, 0, 0.1, 0.5, 0.4), t_s=3.2)
    first = drawn(world)
    assert first.shape == (240, 320, 3)
    assert first.dtype == np.uint8
    assert (drawn(world) == first).all()
    # What was drawn before must not show: bodies of others, places of before.
    with Renderer(scenery, MOUNT, seed=5) as renderer:
        renderer.draw(replace(world, people=CROWD[:2], robot=RobotState(2, 1, 1, 0, 0)))
        assert (renderer.draw(world) == first).all()


def test_pixels_are_the_same_in_another_process() -> None:
    script = (
        "from tests.unit.simulator.test_render_pictures import *\n"
        "import zlib; print(zlib.crc32(drawn(StillWorld(CROWD)).tobytes()))"
    )
    said = [
        subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60,
                       check=True).stdout for _ in range(2)
    ]  # fmt: skip
    assert said[0] == said[1] != ""


def test_another_seed_is_another_place() -> None:
    world = StillWorld(scenery=ROOM)
    assert (drawn(world, seed=1, effects=PERFECT) != drawn(world, seed=2, effects=PERFECT)).any()


@pytest.mark.parametrize("floor", ["tiles", "wood", "asphalt", "grass"])
def test_the_ground_has_enough_to_track(floor: Floor) -> None:
    scenery = Scenery((-15, -15, 15, 15), False, floor, ())
    with Renderer(scenery, CameraMount(), PERFECT) as renderer:
        picture = renderer.draw(StillWorld(scenery=scenery))
        turned = renderer.draw(StillWorld(scenery=scenery, robot=RobotState(0.05, 0, 0.02, 0, 0)))
    before, after = (cv2.cvtColor(p, cv2.COLOR_BGR2GRAY)[280:] for p in (picture, turned))
    corners = cv2.goodFeaturesToTrack(before, 300, 0.02, 8)
    assert corners is not None
    assert len(corners) >= 100
    found, status, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, np.empty_like(corners))
    back, returned, _ = cv2.calcOpticalFlowPyrLK(after, before, found, np.empty_like(corners))
    there = (np.linalg.norm(back - corners, axis=-1) < 0.5) & (status & returned).astype(bool)
    assert there.mean() > 0.75, "moved by 5 cm and a degree, most are found again"


def test_clothes_tell_people_apart() -> None:
    red = replace(OUTFIT, top=(220, 30, 30), legs=(40, 40, 40))
    crops = []
    for outfit in (OUTFIT, red):
        picture = drawn(StillWorld((person(3.0, 0.0, 3.14, outfit=outfit),)), effects=PERFECT)
        crops.append(picture[100:125, 152:168].reshape(-1, 3).mean(axis=0))
    assert crops[0].argmax() == 0
    assert crops[1].argmax() == 2


def test_twins_wear_the_same_pattern_and_patterns_differ() -> None:
    seen = set()
    for seed in range(40):
        people = scenario("twin", seed).people
        weaves = dict(zip((p.role for p in people), weaves_of([p.outfit for p in people]),
                          strict=True))  # fmt: skip
        assert weaves["twin"] == weaves["target"], seed
        seen.add(weaves["target"])
    assert len(seen) >= 4


def test_somebody_who_leaves_is_gone() -> None:
    with Renderer(MEADOW, MOUNT, PERFECT) as renderer:
        empty = renderer.draw(StillWorld())
        assert (renderer.draw(StillWorld((person(3, 0),))) != empty).any()
        assert (renderer.draw(StillWorld()) == empty).all()


def test_obstacles_stand_where_the_world_has_them() -> None:
    pillar = Obstacle("pillar", 4.0, 0.0, 0.0, 0.4, 0.4, 2.5, (20, 20, 250))
    scenery = Scenery((-15, -15, 25, 15), False, "grass", (pillar,))
    with Renderer(scenery, CameraMount(), PERFECT) as renderer:
        picture = renderer.draw(StillWorld(scenery=scenery)).astype(int)
    blue = picture[240, :, 0] > 1.8 * picture[240, :, 1]
    # Its near face is 0.4 m wide and 3.8 m away.
    half = 320 * 0.2 / 3.8
    assert np.flatnonzero(blue)[[0, -1]] == pytest.approx([320 - half, 320 + half], abs=2)


def test_a_closed_renderer_gives_its_memory_back() -> None:
    def open_some(count: int) -> float:
        for seed in range(count):
            drawn(StillWorld(CROWD, ROOM), seed)
        return memory_mb()[0]

    # Textures are 15 MB a renderer, and an episode has one of its own.
    before = open_some(3)
    assert open_some(5) - before < 25.0
