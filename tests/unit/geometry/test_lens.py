"""Lenses: rays of pixels, bearings across a wide picture, and what has no inverse."""

from __future__ import annotations

import math

import numpy as np
import pytest

from heel.schemas import CameraInfo
from heel.services.geometry.camera import GroundCamera, Pinhole, camera_from_info, resized
from heel.services.geometry.lens import Lens

WIDTH, HEIGHT = 1280, 720
FISHEYE = Lens(True, (560.0, 558.0), (643.0, 355.0), (-0.02, 0.004, -0.002, 0.0004))
BARREL = Lens(False, (420.0, 421.0), (645.0, 352.0), (-0.12, 0.018, 0.0008, -0.0005, -0.001))
LENSES = pytest.mark.parametrize("lens", [FISHEYE, BARREL], ids=["fisheye", "barrel"])


def across(half_deg: float = 60.0) -> list[float]:
    return [math.radians(degrees) for degrees in np.linspace(-half_deg, half_deg, 25).tolist()]


@LENSES
def test_bearings_are_right_across_120_degrees(lens: Lens) -> None:
    camera = Pinhole.through(lens, WIDTH, HEIGHT)
    for bearing_rad in across():
        for down in (-0.2, 0.0, 0.3):
            u_px, v_px = lens.pixels((math.tan(bearing_rad), down)).tolist()
            assert camera.bearing_rad(u_px, v_px) == pytest.approx(-bearing_rad, abs=0.001)


@LENSES
def test_a_pinhole_would_be_wrong_there(lens: Lens) -> None:
    """Else the test above could not fail."""
    plain = Pinhole(WIDTH, HEIGHT, lens.focal_px[0], *lens.centre_px)
    u_px, v_px = lens.pixels((math.tan(math.radians(50)), 0.0)).tolist()
    assert abs(plain.bearing_rad(u_px, v_px) + math.radians(50)) > math.radians(3)


@LENSES
def test_people_stand_where_they_are_seen(lens: Lens) -> None:
    camera = Pinhole.through(lens, WIDTH, HEIGHT).mounted(1.1, 0.1)
    places = np.array([[2.0, 0.0], [2.0, 1.5], [3.0, -3.5], [8.0, 4.0]])
    boxes = camera.person_boxes(places, 1.75)
    feet = np.stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]], axis=1)
    assert np.abs(camera.pixels(np.c_[places, np.zeros(4)]) - feet).max() < 12
    seen = camera.pixels(np.c_[places, np.zeros(4)])
    assert camera.ground(seen) == pytest.approx(places, abs=0.01)
    for (u_px, v_px), (ahead_m, left_m) in zip(seen.tolist(), places.tolist(), strict=True):
        assert camera.bearing_rad(u_px, v_px) == pytest.approx(
            math.atan2(left_m, ahead_m), abs=1e-3
        )
        fall = 1.1 / math.hypot(ahead_m, left_m)
        assert camera.slope(u_px, v_px) == pytest.approx(fall, rel=0.01)


def test_without_distortion_a_lens_is_a_pinhole() -> None:
    lens = Lens(False, (500.0, 500.0), (640.0, 360.0))
    plain, through = Pinhole(WIDTH, HEIGHT, 500.0), Pinhole.through(lens, WIDTH, HEIGHT)
    for pixel in ((0.0, 0.0), (640.0, 360.0), (1279.0, 10.0)):
        assert through.bearing_rad(*pixel) == pytest.approx(plain.bearing_rad(*pixel), abs=1e-9)
        assert through.slope(*pixel) == pytest.approx(plain.slope(*pixel), abs=1e-9)
    assert through.horizontal_fov_rad == pytest.approx(plain.horizontal_fov_rad)


@pytest.mark.parametrize("pixel", [(0.0, 0.0), (-4000.0, 300.0), (643.0, 9000.0)])
def test_rays_of_a_rim_and_beyond_are_finite_and_point_outward(pixel: tuple[float, float]) -> None:
    lens = Lens(True, (230.0, 230.0), (640.0, 360.0), (0.05, 0.01, 0.0, 0.0))
    ray = lens.rays(pixel)
    assert np.isfinite(ray).all()
    assert float(ray @ (np.array(pixel) - lens.centre_px)) > 0
    assert np.hypot(*ray) <= 11.5


def test_a_polynomial_without_an_inverse_at_the_rim_is_noticed() -> None:
    assert FISHEYE.covers(WIDTH, HEIGHT)
    assert BARREL.covers(WIDTH, HEIGHT)
    folded = Lens(False, (300.0, 300.0), (640.0, 360.0), (-0.4, 0.05))
    assert not folded.covers(WIDTH, HEIGHT)
    assert folded.covers(WIDTH // 4, HEIGHT // 4) is False, "its centre is not in that picture"
    assert Lens(False, (300.0, 300.0), (160.0, 90.0), (-0.4, 0.05)).covers(320, 180)


@LENSES
def test_a_smaller_picture_has_the_same_bearings(lens: Lens) -> None:
    info = CameraInfo(
        stream="front", epoch=1, width=WIDTH, height=HEIGHT, source_width=WIDTH,
        source_height=HEIGHT, fps=25.0, source="test", lens=lens.model(), mount_height_m=0.8,
        mount_pitch_rad=0.05,
    )  # fmt: skip
    full = camera_from_info(info)
    half = camera_from_info(resized(info, 640, 240))
    assert isinstance(full, GroundCamera)
    assert isinstance(half, GroundCamera)
    assert (half.mount_height_m, half.pitch_rad) == (0.8, 0.05)
    for u_px in (10.0, 600.0, 1200.0):
        want = full.bearing_rad(u_px, 300.0)
        assert half.bearing_rad(u_px / 2, 100.0) == pytest.approx(want, abs=1e-6)
