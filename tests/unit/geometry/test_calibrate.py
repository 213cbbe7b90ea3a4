"""Mounting from the boxes of somebody who walks about, and refusals of what does not tell it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas import SettingsError
from heel.services.capture.describe import mounting
from heel.services.capture.scene_source import open_scene
from heel.services.capture.settings import CaptureSettings
from heel.services.geometry.calibrate import CalibrationError, estimate_mount
from heel.services.geometry.calibration_file import (
    calibration_of,
    read_calibration,
    write_calibration,
)
from heel.services.geometry.camera import GroundCamera, Pinhole

SIZE = (640, 480)
FOV_RAD = math.radians(70)


def camera(mount_height_m: float, pitch_rad: float, fov_rad: float = FOV_RAD) -> GroundCamera:
    return Pinhole.from_fov(*SIZE, fov_rad).mounted(mount_height_m, pitch_rad)


def walked(
    looking: GroundCamera, height_m: float = 1.75, noise_px: float = 1.5,
    near_m: float = 2.5, far_m: float = 9.0, torn: float = 0.0,
) -> NDArray[np.float64]:  # fmt: skip
    """Boxes of a person who walks about, some of them torn off at the waist."""
    random = np.random.default_rng(3)
    x = random.uniform(near_m, far_m, 200)
    y = x * random.uniform(-0.5, 0.5, 200)
    boxes = looking.person_boxes(np.stack([x, y], -1), height_m)
    boxes += random.normal(0, noise_px, boxes.shape)
    cut = random.random(200) < torn
    boxes[cut, 3] -= 0.5 * (boxes[cut, 3] - boxes[cut, 1])
    return boxes


@pytest.mark.parametrize("torn", [0.0, 0.15], ids=["clean", "torn boxes"])
@pytest.mark.parametrize(
    ("mount_height_m", "pitch_rad"), [(0.8, 0.0), (0.5, -0.15), (1.3, 0.1), (3.0, 0.35)]
)
def test_height_and_pitch_are_found_when_the_field_of_view_is_given(
    mount_height_m: float, pitch_rad: float, torn: float
) -> None:
    looking = camera(mount_height_m, pitch_rad)
    found = estimate_mount(walked(looking, torn=torn), SIZE, 1.75, FOV_RAD)
    assert found.camera.mount_height_m == pytest.approx(mount_height_m, rel=0.05)
    assert found.camera.pitch_rad == pytest.approx(pitch_rad, abs=0.015)
    assert found.fov_sigma_rad == 0
    assert found.residual_px < 6


def test_a_camera_that_looks_down_steeply_tells_its_field_of_view_too() -> None:
    looking = camera(4.0, 0.6, math.radians(60))
    found = estimate_mount(walked(looking, noise_px=0.5), SIZE, 1.75)
    assert found.camera.horizontal_fov_rad == pytest.approx(math.radians(60), rel=0.08)
    assert found.camera.mount_height_m == pytest.approx(4.0, rel=0.08)
    assert 0 < found.fov_sigma_rad < 0.1


def test_the_drawn_scene_is_found_from_its_true_boxes() -> None:
    """It is level with its axis shifted up; near the horizon a pitched camera is the same."""
    scene = open_scene("scene:demo").scene
    people: dict[int, list[tuple[float, float, float, float]]] = {}
    for index in range(0, scene.frame_count, 2):
        for person in scene.truth(index):
            if person.visible_fraction > 0.95:
                people.setdefault(person.person_id, []).append(person.box_xyxy)
    found = []
    for boxes in people.values():
        try:
            found.append(
                estimate_mount(np.array(boxes), SIZE, 1.7, 2 * math.atan(320 / 560)).camera
            )
        except CalibrationError:
            continue
    assert found
    assert found[0].mount_height_m == pytest.approx(3.2, rel=0.15)
    assert found[0].horizon_px == pytest.approx(110, abs=25)


def test_the_stated_uncertainty_grows_with_noise() -> None:
    looking = camera(0.8, 0.05)
    quiet, loud = (
        estimate_mount(walked(looking, noise_px=noise_px), SIZE, 1.75, FOV_RAD)
        for noise_px in (0.5, 4.0)
    )
    assert loud.mount_height_sigma_m > 2 * quiet.mount_height_sigma_m
    assert loud.residual_px > 2 * quiet.residual_px


@pytest.mark.parametrize(
    ("boxes", "fov_rad", "words"),
    [
        (walked(camera(0.8, 0.0))[:20], FOV_RAD, "20 of 20 boxes"),
        (walked(camera(0.8, 0.0), near_m=0.5, far_m=1.2), FOV_RAD, "step back"),
        (walked(camera(0.8, 0.0), near_m=5.0, far_m=5.3), FOV_RAD, "let them walk"),
        (walked(camera(0.8, 0.0)), None, "give --fov-deg"),
        (np.random.default_rng(0).uniform(10, 470, (200, 4)), FOV_RAD, "one upright person"),
    ],
    ids=["few", "cut off", "always as far", "level without field of view", "no person"],
)
def test_what_does_not_determine_the_camera_is_refused_with_the_remedy(
    boxes: NDArray[np.float64], fov_rad: float | None, words: str
) -> None:
    boxes = np.stack([boxes[:, :2], boxes[:, 2:]], 1)
    boxes = np.concatenate([boxes.min(axis=1), boxes.max(axis=1)], axis=1)
    with pytest.raises(CalibrationError, match=words):
        estimate_mount(boxes, SIZE, 1.75, fov_rad)


def test_a_calibration_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    found = estimate_mount(walked(camera(0.8, 0.1)), SIZE, 1.75, FOV_RAD)
    written = calibration_of(found, 'a "quoted" \\ name.mp4', 1.75)
    write_calibration(tmp_path / "camera.toml", written)
    assert read_calibration(tmp_path / "camera.toml") == written
    assert written.made is not None
    assert written.made.boxes == found.boxes


def test_capture_tells_what_the_file_says_unless_a_setting_wins(tmp_path: Path) -> None:
    file = tmp_path / "camera.toml"
    file.write_text("mount_height_m = 0.8\nmount_pitch_deg = 10\nhorizontal_fov_deg = 90\n")
    told = mounting(CaptureSettings(calibration=file, mount_height_m=1.0))
    assert told.mount_height_m == 1.0
    assert told.mount_pitch_rad == pytest.approx(math.radians(10))
    assert told.horizontal_fov_rad(640, 480) == pytest.approx(math.pi / 2)
    nothing = mounting(CaptureSettings())
    assert nothing.horizontal_fov_rad(640, 480) is nothing.mount_height_m is None
    assert nothing.mount_pitch_rad is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "No such file"),
        ("mount_height_m = ", "is not TOML"),
        ("mount_height_m = 0.8\nmount_pitch_deg = 1\nhorizontal_fov_deg = 200\n", "horizontal_fov"),
        ("mount_height = 0.8\n", "Field required|not permitted"),
    ],
)
def test_a_bad_calibration_file_is_one_error_that_names_it(
    tmp_path: Path, text: str | None, words: str
) -> None:
    file = tmp_path / "camera.toml"
    if text is not None:
        file.write_text(text)
    with pytest.raises(SettingsError, match=words) as error:
        read_calibration(file)
    assert str(file) in str(error.value)
