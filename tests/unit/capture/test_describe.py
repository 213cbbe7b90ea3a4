"""What capture says of its camera: its settings, the calibration file, and the lens."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from heel.schemas import SettingsError
from heel.services.capture.describe import mounting
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
