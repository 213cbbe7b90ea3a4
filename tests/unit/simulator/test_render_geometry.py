from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("panda3d", reason="the extra sim is not installed")

from heel.services.simulator.render.effects import CameraEffects
from heel.services.simulator.render.renderer import Renderer
from heel.services.simulator.solids import Solids
from heel.services.simulator.state import CameraMount, PersonState, RobotState
from heel.services.simulator.views import lens, look
from tests.unit.simulator.drawn_world import MEADOW, StillWorld, person

FOOT_M = 0.16
"""How much nearer than the middle of the body a shoe can end."""
MOUNTS = {
    "level": CameraMount(),
    "pitched": CameraMount(pitch_rad=0.2, height_m=1.1, horizontal_fov_rad=1.2),
    "wide": CameraMount(width_px=800, height_px=400, horizontal_fov_rad=1.9),
}


@pytest.fixture(scope="module", params=MOUNTS)
def camera(request: pytest.FixtureRequest) -> Iterator[tuple[CameraMount, Renderer]]:
    mount = MOUNTS[request.param]
    with Renderer(MEADOW, mount, seed=3) as renderer:
        yield mount, renderer


def silhouette(renderer: Renderer, world: StillWorld) -> NDArray[np.float64]:
    """Edges (left, top, right, bottom) of what appears when the people do."""
    empty = renderer.draw_clean(StillWorld(robot=world.robot)).astype(int)
    drawn = renderer.draw_clean(world).astype(int)
    # The figures are blue; their shadow on the ground is not.
    new = (np.abs(drawn - empty).max(axis=2) > 20) & (drawn[..., 0] > 1.8 * drawn[..., 1])
    rows, columns = np.flatnonzero(new.any(axis=1)), np.flatnonzero(new.any(axis=0))
    return np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1], float)


def assert_upright(
    seen: NDArray[np.float64], box: NDArray[np.float64], mount: CameraMount, somebody: PersonState
) -> None:
    """The head ends where the box does; so do the feet, but for those that stand nearer."""
    assert seen[1] == pytest.approx(box[1], abs=2.0)
    near = StillWorld((replace(somebody, x_m=somebody.x_m - FOOT_M),))
    nearest_foot = look(near, Solids(()), mount).box_xyxy[0][3]
    assert box[3] - 1.0 <= seen[3] <= nearest_foot + 2.0


@pytest.mark.parametrize(
    "stander", [person(4.0, 0.0, math.pi / 2), person(5.0, 2.0, -1.0), person(7.0, -3.0, 2.6),
                person(4.5, 0.8, 1.9, height_m=1.5), person(6.0, 1.0, 0.3, height_m=1.95)],
)  # fmt: skip
def test_a_standing_person_fills_their_true_box(
    camera: tuple[CameraMount, Renderer], stander: PersonState
) -> None:
    mount, renderer = camera
    world = StillWorld((stander,))
    box = look(world, Solids(()), mount).box_xyxy[0]
    seen = silhouette(renderer, world)
    assert_upright(seen, box, mount, stander)
    if mount.pitch_rad == 0:
        # Toes point ahead. By a pitched camera a person leans, and the true box does not.
        assert (seen[0] + seen[2]) / 2 == pytest.approx((box[0] + box[2]) / 2, abs=4.0)
    # Shoulders are narrower from the side, and the true box has one width for all.
    assert 0.35 * (box[2] - box[0]) < seen[2] - seen[0] < 1.2 * (box[2] - box[0]) + 2.0


@pytest.mark.parametrize("robot", [RobotState(1.0, -2.0, 0.7, 0, 0), RobotState(-3, 2, -0.3, 0, 0)])
def test_the_picture_is_taken_from_where_the_robot_is(
    camera: tuple[CameraMount, Renderer], robot: RobotState
) -> None:
    mount, renderer = camera
    x_m = robot.x_m + 5 * math.cos(robot.heading_rad + 0.25)
    y_m = robot.y_m + 5 * math.sin(robot.heading_rad + 0.25)
    world = StillWorld((person(x_m, y_m, robot.heading_rad),), robot=robot)
    box = look(world, Solids(()), mount).box_xyxy[0]
    seen = silhouette(renderer, world)
    assert seen[1] == pytest.approx(box[1], abs=2.0)
    assert seen[3] == pytest.approx(box[3], abs=3.0)


def test_walking_keeps_feet_on_the_ground_and_the_head_where_it_is() -> None:
    mount = CameraMount()
    with Renderer(MEADOW, mount, CameraEffects(0, 0, 0)) as renderer:
        widths = []
        for stride_rad in np.linspace(0, 2 * math.pi, 9):
            # Side-on, so that both feet are equally far away.
            world = StillWorld((person(5.0, 0.0, math.pi / 2, 1.2, float(stride_rad)),))
            seen = silhouette(renderer, world)
            box = look(world, Solids(()), mount).box_xyxy[0]
            assert seen[1] == pytest.approx(box[1], abs=2.0)
            assert seen[3] == pytest.approx(box[3], abs=3.0)
            widths.append(seen[2] - seen[0])
    assert max(widths) > 1.5 * min(widths), "legs and arms swing"


def test_who_is_nearer_hides_who_is_behind() -> None:
    with Renderer(MEADOW, CameraMount()) as renderer:
        both = StillWorld((person(3.0, 0.0, number=1), person(6.0, 0.0, number=2)))
        alone = StillWorld((person(3.0, 0.0, number=1),))
        torso = (slice(185, 225), slice(312, 328))
        difference = renderer.draw_clean(both).astype(int) - renderer.draw_clean(alone)
        assert np.abs(difference[torso]).max() == 0


def test_true_depth_is_that_of_the_floor_and_of_who_stands_on_it(
    camera: tuple[CameraMount, Renderer],
) -> None:
    mount, renderer = camera
    world = StillWorld((person(4.0, 0.5, math.pi / 2),))
    true_m = renderer.true_depth(world)
    height, width = mount.height_px // 2, mount.width_px // 2
    assert true_m.shape == (height, width)
    rows, columns = np.mgrid[:height, :width] * 2.0 + 1.0
    _, _, fall = lens(mount).rays(np.stack([columns, rows], axis=-1))
    floor_m = mount.height_m / np.where(fall > 0.01, fall, np.nan)
    sight = look(world, Solids(()), mount)
    left, top, right, bottom = (sight.box_xyxy[0] / 2).round().astype(int)
    body = np.zeros(true_m.shape, bool)
    body[max(top - 2, 0) : bottom + 12, left - 12 : right + 12] = True
    for within_m, error in ((3.0, 0.015), (10.0, 0.06)):
        near = ~body & (floor_m < within_m)
        assert near.sum() > 1000
        assert np.abs(true_m[near] / floor_m[near] - 1.0).max() < error
    middle = slice((left + right) // 2 - 2, (left + right) // 2 + 3)
    chest = true_m[top + (bottom - top) // 4 : top + (bottom - top) // 3, middle]
    # They show their shoulder.
    assert 0.05 < sight.depth_m[0] - float(np.median(chest)) < 0.33
    assert np.all(true_m[~body & ~(floor_m < 40.0)] == 0.0)


def test_depth_leaves_the_picture_as_it_was(camera: tuple[CameraMount, Renderer]) -> None:
    _, renderer = camera
    world = StillWorld((person(4.0, 0.5, math.pi / 2),))
    before = renderer.draw_clean(world)
    first = renderer.measure(world)
    assert np.array_equal(renderer.draw_clean(world), before)
    assert np.array_equal(renderer.measure(world), first)
