"""From ground to pixels and back, and how sure that is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heel.schemas import CameraInfo
from heel.services.geometry.camera import GroundCamera, Pinhole, camera_from_info, focal_length_px


def camera(
    mount_height_m: float = 0.8, pitch_rad: float = 0.0, fov_rad: float = math.pi / 2
) -> GroundCamera:
    return Pinhole.from_fov(640, 480, fov_rad).mounted(mount_height_m, pitch_rad)


def test_a_level_camera_sees_by_the_rule_of_three() -> None:
    level = camera(0.8)
    assert level.focal_px == pytest.approx(320)
    assert level.horizon_px == 240
    assert level.pixels([4.0, 1.0, 0.0]) == pytest.approx([320 - 80, 240 + 64])
    assert level.ground([240.0, 304.0]) == pytest.approx([4.0, 1.0])


def test_a_camera_pitched_down_sees_the_horizon_higher_and_the_axis_meets_the_ground() -> None:
    down = camera(1.0, math.pi / 4)
    assert down.horizon_px == pytest.approx(240 - 320)
    assert down.ground([320.0, 240.0]) == pytest.approx([1.0, 0.0])


@settings(deadline=None, derandomize=True)
@given(
    x=st.floats(0.5, 30), y=st.floats(-10, 10), height=st.floats(0.3, 10),
    pitch=st.floats(-0.4, 1.2), fov=st.floats(0.5, 2.5),
)  # fmt: skip
def test_ground_to_pixel_and_back_is_the_same_place(
    x: float, y: float, height: float, pitch: float, fov: float
) -> None:
    looking = camera(height, pitch, fov)
    pixel = looking.pixels([x, y, 0.0])
    if np.isfinite(pixel).all():
        assert looking.ground(pixel) == pytest.approx([x, y], rel=1e-6, abs=1e-6)
        assert looking.bearing_rad(*pixel) == pytest.approx(math.atan2(y, x), abs=1e-6)
        slope = looking.slope(*pixel)
        assert slope == pytest.approx(height / math.hypot(x, y), rel=1e-6)


def test_nothing_on_the_ground_is_at_or_above_the_horizon_or_behind() -> None:
    level = camera()
    assert np.isnan(level.ground([[320.0, 240.0], [320.0, 0.0]])).all()
    assert np.isnan(level.pixels([-1.0, 0.0, 0.0])).all()
    assert np.isnan(level.person_height_px([320.0, 200.0], 1.7))


def test_arrays_of_any_shape_keep_it() -> None:
    looking = camera()
    ground = np.array([[[2.0, 0.5], [3.0, 0.0], [9.0, -2.0]], [[4.0, 0.1], [5.0, 0.0], [6.0, 1.0]]])
    assert looking.person_boxes(ground, 1.7).shape == (2, 3, 4)
    assert looking.ground(np.full((2, 3, 2), 300.0)).shape == (2, 3, 2)


def test_a_person_is_as_tall_in_the_picture_as_the_rule_of_three_says() -> None:
    level = camera(0.8)
    assert level.person_height_px([320.0, 304.0], 1.6) == pytest.approx(128)
    box = level.person_boxes([4.0, 0.0], 1.6, 0.5)
    assert box == pytest.approx([300, 176, 340, 304])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Pinhole(640, 480, 0.0), "focal length 0 px"),
        (lambda: Pinhole(0, 480, 300.0), "0x480"),
        (lambda: camera(0.0), "0 m above ground"),
        (lambda: camera(math.nan), "nan m above ground"),
        (lambda: camera(1.0, 1.6), "1.6 rad"),
        (lambda: focal_length_px(640, math.pi), "field of view of 3.14159 rad"),
    ],
)
def test_impossible_cameras_are_refused_by_name_and_value(make: object, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()  # type: ignore[operator]


def info(**changes: object) -> CameraInfo:
    values = {"stream": "front", "epoch": 1, "width": 640, "height": 480, "source_width": 640,
              "source_height": 480, "fps": 20.0, "source": "a test"}  # fmt: skip
    return CameraInfo.model_validate(values | changes)


def test_a_described_camera_is_mounted_only_if_height_and_pitch_are_known() -> None:
    full = camera_from_info(
        info(horizontal_fov_rad=math.pi / 2, mount_height_m=0.8, mount_pitch_rad=0.1)
    )
    assert full == camera(0.8, 0.1)
    for missing in ({"mount_height_m": 0.8}, {"mount_pitch_rad": 0.0},
                    {"mount_height_m": 0.0, "mount_pitch_rad": 0.0}):  # fmt: skip
        got = camera_from_info(info(horizontal_fov_rad=1.0, **missing))
        assert type(got) is Pinhole
        assert got.horizontal_fov_rad == pytest.approx(1.0)


def test_a_field_of_view_of_ones_own_serves_where_the_camera_states_none() -> None:
    assert camera_from_info(info()) is None
    assert camera_from_info(info(), 1.2) == Pinhole.from_fov(640, 480, 1.2)
    assert camera_from_info(info(horizontal_fov_rad=1.0), 1.2) == Pinhole.from_fov(640, 480, 1.0)
