"""What capture says of its camera: its settings, the calibration file, and the lens."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from heel.schemas import CameraInfo, SettingsError
from heel.services.capture.describe import completed, mounting
from heel.services.capture.settings import CaptureSettings
from heel.services.geometry.lens import Lens
from heel.services.geometry.lens_file import LensFile, write_lens

LENS = Lens(True, (240.0, 241.0), (322.0, 238.0), (-0.02, 0.004, -0.001, 0.0002))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "lens.yaml"
    write_lens(path, LensFile(640, 480, LENS), "front")
    return path


def test_a_lens_tells_field_of_view_and_distortion(file: Path) -> None:
    told = mounting(CaptureSettings(source="scene:demo", lens=file, horizontal_fov_deg=60.0))
    model = told.lens(640, 480)
    assert model is not None
    assert (model.model, model.focal_px, model.centre_px) == (
        "equidistant", LENS.focal_px, LENS.centre_px,
    )  # fmt: skip
    assert told.horizontal_fov_rad(640, 480) == pytest.approx(math.radians(157), abs=0.05)
    half = told.lens(320, 240)
    assert half is not None
    assert half.focal_px == (120.0, 120.5)


def test_pictures_of_another_shape_than_the_lens_are_refused(file: Path) -> None:
    told = mounting(CaptureSettings(source="scene:demo", lens=file))
    with pytest.raises(SettingsError, match="another shape"):
        told.lens(640, 360)


def test_without_a_lens_the_stated_field_of_view_counts() -> None:
    told = mounting(CaptureSettings(source="scene:demo", horizontal_fov_deg=60.0))
    assert told.lens(640, 480) is None
    assert told.horizontal_fov_rad(640, 480) == pytest.approx(math.radians(60))


def test_what_was_recorded_of_a_camera_counts_where_nothing_is_stated(file: Path) -> None:
    recorded = CameraInfo(
        stream="front", epoch=1, width=320, height=240, source_width=320, source_height=240,
        fps=25.0, source="then", horizontal_fov_rad=1.2, mount_height_m=0.8, mount_pitch_rad=0.1,
        mount_yaw_rad=0.2, lens=LENS.scaled(0.5, 0.5).model(),
    )  # fmt: skip
    told = completed(mounting(CaptureSettings()), recorded)
    assert (told.mount_height_m, told.mount_pitch_rad, told.mount_yaw_rad) == (0.8, 0.1, 0.2)
    assert told.lens(320, 240) == recorded.lens
    assert told.lens(640, 480) == LENS.model()
    stated = completed(mounting(CaptureSettings(horizontal_fov_deg=60.0)), recorded)
    assert stated.lens(320, 240) is None
    assert stated.horizontal_fov_rad(320, 240) == pytest.approx(math.radians(60))
    own = mounting(CaptureSettings(lens=file, mount_height_m=1.5, mount_pitch_deg=0.0))
    both = completed(own, recorded)
    assert both.lens_file is own.lens_file
    assert (both.mount_height_m, both.mount_pitch_rad) == (1.5, 0.0)
    assert completed(own, None) is own
