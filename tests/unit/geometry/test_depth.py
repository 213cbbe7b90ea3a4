"""Depth pictures of scenes whose geometry is known: bodies, and what stands in the way."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from heel.schemas import Ranges, RangeSector, encode
from heel.services.geometry.camera import GroundCamera, Pinhole
from heel.services.geometry.depth import body_place, depth_sectors

CAMERA = Pinhole.from_fov(640, 480, math.pi / 2).mounted(0.8, 0.0)
SHAPE = (240, 320)
WALL_M = 6.0
Depth = NDArray[np.uint16]


def millimetres(metres: NDArray[np.float64]) -> Depth:
    return np.rint(np.where(np.isfinite(metres), metres, 0) * 1000).astype(np.uint16)


def rays(camera: GroundCamera, shape: tuple[int, int] = SHAPE) -> tuple[NDArray[np.float64], ...]:
    rows, columns = np.mgrid[: shape[0], : shape[1]] + 0.5
    factors = camera.width_px / shape[1], camera.height_px / shape[0]
    return camera.rays(np.stack([columns * factors[0], rows * factors[1]], axis=-1))


def empty(camera: GroundCamera = CAMERA, shape: tuple[int, int] = SHAPE) -> NDArray[np.float64]:
    """Metres of a floor that ends at a wall."""
    ahead, _, fall = rays(camera, shape)
    floor = np.where(fall > 1e-9, camera.mount_height_m / np.maximum(fall, 1e-9), np.inf)
    return np.minimum(floor, WALL_M / ahead)


def standing(
    metres: NDArray[np.float64], x_m: float, left_m: tuple[float, float],
    up_m: tuple[float, float], camera: GroundCamera = CAMERA,
) -> NDArray[np.float64]:  # fmt: skip
    """The same with an upright sheet at x_m ahead."""
    ahead, left, fall = rays(camera, metres.shape)  # type: ignore[arg-type]
    z_m = x_m / ahead
    up = camera.mount_height_m - z_m * fall
    there = (up > up_m[0]) & (up < up_m[1]) & (z_m > 0)
    there &= (z_m * left > left_m[0]) & (z_m * left < left_m[1]) & (z_m < metres)
    return np.where(there, z_m, metres)


def person(
    x_m: float, y_m: float = 0.0, wide_m: float = 0.5, tall_m: float = 1.7
) -> tuple[NDArray[np.float64], tuple[float, ...]]:
    """Depth of somebody whose front is at x_m, and the box around them."""
    box = CAMERA.person_boxes([[x_m, y_m]], [tall_m], [wide_m])[0]
    seen = standing(empty(), x_m, (y_m - wide_m / 2, y_m + wide_m / 2), (0.0, tall_m))
    return seen, tuple(box.tolist())


def noisy(metres: NDArray[np.float64], seed: int = 1) -> Depth:
    rng = np.random.default_rng(seed)
    return millimetres(metres * (1 + 0.01 * metres * rng.standard_normal(metres.shape)))


@pytest.mark.parametrize("y_m", [-0.6, 0.0, 0.6])
@pytest.mark.parametrize("x_m", [1.0, 1.5, 2.0, 3.0, 4.0])
def test_a_person_is_as_far_as_the_middle_of_the_body(x_m: float, y_m: float) -> None:
    metres, box = person(x_m, y_m)
    place = body_place(noisy(metres), box, CAMERA)
    assert place is not None
    assert place.distance_m == pytest.approx(math.hypot(x_m, y_m) + 0.11, rel=0.03)
    assert place.bearing_rad == pytest.approx(math.atan2(y_m, x_m), abs=0.02)
    assert 0.03 < place.distance_sigma_m < 0.2


@pytest.mark.parametrize("wall_m", [3.2, 4.0, 6.0])
def test_a_wall_that_fills_most_of_the_box_is_not_the_person(wall_m: float) -> None:
    metres, box = person(2.0, wide_m=0.25)
    wide = (box[0] - 60, box[1], box[2] + 60, box[3])
    place = body_place(noisy(np.minimum(metres, wall_m)), wide, CAMERA)
    assert place is not None
    assert place.distance_m == pytest.approx(2.11, abs=0.1)


def test_something_before_a_part_of_the_body_is_not_the_person() -> None:
    metres, box = person(3.0)
    branch = standing(metres, 1.2, (-0.02, 0.02), (0.0, 1.7))
    place = body_place(noisy(branch), box, CAMERA)
    assert place is not None
    assert place.distance_m == pytest.approx(3.11, abs=0.12)


def test_what_is_too_near_for_such_a_box_is_not_the_person() -> None:
    metres, box = person(3.0)
    hand = standing(metres, 0.4, (-0.2, 0.2), (0.5, 1.1))
    assert body_place(noisy(hand), box, CAMERA) is None


def test_a_person_in_front_is_left_out_of_the_one_behind() -> None:
    metres, box = person(3.0)
    both = standing(metres, 2.2, (-0.25, 0.1), (0.0, 1.7))
    front = tuple(CAMERA.person_boxes([[2.2, -0.075]], [1.7], [0.35])[0].tolist())
    seen = body_place(noisy(both), box, CAMERA)
    told = body_place(noisy(both), box, CAMERA, [front])
    assert seen is not None
    assert seen.distance_m < 2.5
    assert told is not None
    assert told.distance_m == pytest.approx(3.11, abs=0.12)


def test_holes_take_pixels_and_no_accuracy_until_too_few_are_left() -> None:
    metres, box = person(2.0)
    chance = np.random.default_rng(2).random(SHAPE)
    sparse = body_place(np.where(chance < 0.1, noisy(metres), 0).astype(np.uint16), box, CAMERA)
    assert sparse is not None
    assert sparse.distance_m == pytest.approx(2.11, abs=0.06)
    few = np.where(chance < 0.003, noisy(metres), 0).astype(np.uint16)
    assert body_place(few, box, CAMERA) is None
    assert body_place(np.zeros(SHAPE, np.uint16), box, CAMERA) is None


def test_the_picture_may_have_more_pixels_than_its_depth() -> None:
    metres, box = person(2.5, 0.4)
    half = body_place(millimetres(metres), box, CAMERA)
    whole = millimetres(standing(empty(shape=(480, 640)), 2.5, (0.15, 0.65), (0.0, 1.7)))
    full = body_place(whole, box, CAMERA)
    assert half is not None
    assert full is not None
    assert full.distance_m == pytest.approx(half.distance_m, abs=0.01)
    assert full.bearing_rad == pytest.approx(half.bearing_rad, abs=0.005)


def test_a_pitched_camera_tells_the_way_along_the_ground() -> None:
    camera = Pinhole.from_fov(640, 480, math.pi / 2).mounted(0.4, -0.3)
    metres = standing(empty(camera), 2.0, (-0.25, 0.25), (0.0, 1.7), camera)
    box = tuple(camera.person_boxes([[2.0, 0.0]], [1.7], [0.5])[0].tolist())
    place = body_place(millimetres(metres), box, camera)
    assert place is not None
    assert place.distance_m == pytest.approx(2.11, abs=0.03)


def test_a_box_that_the_border_cuts_tells_no_bearing() -> None:
    metres, box = person(1.2, 1.1)
    assert box[0] < 0
    place = body_place(millimetres(metres), box, CAMERA)
    assert place is not None
    assert place.bearing_rad is None


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 2**16), share=st.floats(0, 1),
    box=st.tuples(*[st.floats(-700, 1300)] * 4), scale=st.sampled_from([1, 300, 65535]),
)  # fmt: skip
def test_any_picture_and_box_give_a_finite_place_or_none(
    seed: int, share: float, box: tuple[float, float, float, float], scale: int
) -> None:
    rng = np.random.default_rng(seed)
    depth = np.where(rng.random(SHAPE) < share, rng.integers(0, scale, SHAPE), 0)
    left, right = sorted(box[::2])
    top, bottom = sorted(box[1::2])
    place = body_place(depth.astype(np.uint16), (left, top, right + 1, bottom + 1), CAMERA)
    if place is not None:
        assert 0 < place.distance_m < 200
        assert 0 < place.distance_sigma_m < 200
        assert place.bearing_rad is None or abs(place.bearing_rad) < math.pi
    sectors = depth_sectors(depth.astype(np.uint16), CAMERA)
    encode(Ranges(seq=0, sectors=sectors))


def towards(sectors: tuple[RangeSector, ...], bearing_rad: float) -> float:
    return min(sectors, key=lambda one: abs(one.bearing_rad - bearing_rad)).distance_m


@pytest.mark.parametrize("pitch_rad", [-0.02, 0.0, 0.02])
def test_a_floor_is_free_even_if_the_camera_rocks(pitch_rad: float) -> None:
    rocking = Pinhole.from_fov(640, 480, math.pi / 2).mounted(0.8, pitch_rad)
    sectors = depth_sectors(noisy(empty(rocking)), CAMERA)
    assert len(sectors) == 36
    assert min(sector.distance_m for sector in sectors) > 0.8 * WALL_M


def test_a_thing_stands_where_it_is_and_the_rest_is_free() -> None:
    metres = standing(empty(), 1.5, (0.3, 0.7), (0.0, 0.5))
    sectors = depth_sectors(noisy(metres), CAMERA)
    assert towards(sectors, math.atan2(0.5, 1.5)) == pytest.approx(math.hypot(1.5, 0.5), abs=0.08)
    assert towards(sectors, -0.3) > 0.8 * WALL_M
    turned = depth_sectors(noisy(metres), CAMERA, yaw_rad=1.0)
    assert towards(turned, math.atan2(0.5, 1.5) + 1.0) == pytest.approx(1.58, abs=0.08)


@pytest.mark.parametrize(
    ("up_m", "stands"), [((0.0, 0.15), True), ((0.7, 0.78), True), ((1.6, 2.0), False)]
)
def test_thresholds_tables_and_beams(up_m: tuple[float, float], stands: bool) -> None:
    metres = standing(empty(), 1.5, (-0.4, 0.4), up_m)
    assert (towards(depth_sectors(noisy(metres), CAMERA), 0.0) < 2.0) == stands


def test_no_direction_is_between_two_sectors() -> None:
    sectors = depth_sectors(noisy(empty()), CAMERA)
    for bearing_rad in np.linspace(-0.78, 0.78, 313):
        assert any(
            abs(one.bearing_rad - bearing_rad) < one.width_rad / 2 for one in sectors
        ), bearing_rad  # fmt: skip


def test_a_few_stray_pixels_are_no_obstacle() -> None:
    depth = noisy(empty())
    depth[100, 155:160] = 700
    assert towards(depth_sectors(depth, CAMERA), 0.0) > 0.8 * WALL_M


def test_what_is_not_measured_is_not_free() -> None:
    covered = depth_sectors(np.zeros(SHAPE, np.uint16), CAMERA)
    assert all(math.isnan(sector.distance_m) for sector in covered)
    half = noisy(empty())
    half[:, 160:] = 0
    sectors = depth_sectors(half, CAMERA)
    assert math.isnan(towards(sectors, -0.4))
    assert towards(sectors, 0.4) > 0.8 * WALL_M
