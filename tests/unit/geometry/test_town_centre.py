"""The data set's calibration files give the mounting of a camera written in their terms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from heel.schemas import SettingsError
from heel.services.geometry.calibration_file import read_calibration

HEIGHT_M, PITCH, FOCAL_PX = 6.0, math.radians(25.0), 1500.0


def camera_file(**changes: object) -> str:
    """A camera `HEIGHT_M` above (3, -2), pitched down by `PITCH`, in the data set's terms."""
    right, ahead = np.array([0.0, -1.0, 0.0]), np.array([math.cos(PITCH), 0.0, -math.sin(PITCH)])
    rotation = np.stack([right, np.cross(ahead, right), ahead])
    w = 0.5 * math.sqrt(1.0 + np.trace(rotation))
    x, y, z = (
        (rotation[2, 1] - rotation[1, 2]) / (4 * w),
        (rotation[0, 2] - rotation[2, 0]) / (4 * w),
        (rotation[1, 0] - rotation[0, 1]) / (4 * w),
    )
    translation = -rotation @ np.array([3.0, -2.0, HEIGHT_M])
    values: dict[str, object] = {
        "FocalLengthX": FOCAL_PX, "FocalLengthY": FOCAL_PX, "PrincipalPointX": 959.5,
        "TranslationX": translation[0], "TranslationY": translation[1],
        "TranslationZ": translation[2], "RotationX": x, "RotationY": y, "RotationZ": z,
        "RotationW": w, "DistortionK1": -0.6,
    }  # fmt: skip
    return "".join(f"{name} = {value}\n" for name, value in {**values, **changes}.items())


def test_height_pitch_and_field_of_view_are_read(tmp_path: Path) -> None:
    file = tmp_path / "camera.ci"
    file.write_text(camera_file(), encoding="utf-8")
    calibration = read_calibration(file)
    assert calibration.mount_height_m == pytest.approx(HEIGHT_M, abs=1e-3)
    assert calibration.mount_pitch_deg == pytest.approx(25.0, abs=1e-2)
    expected = 2.0 * math.degrees(math.atan(960.0 / FOCAL_PX))
    assert calibration.horizontal_fov_deg == pytest.approx(expected, abs=1e-2)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("FocalLengthX = 5\n", "PrincipalPointX"),
        (camera_file(RotationW="very much"), "very much"),
        ("", "FocalLengthX"),
    ],
    ids=["incomplete", "no number", "empty"],
)
def test_what_is_no_such_file_is_refused_by_name(tmp_path: Path, text: str, named: str) -> None:
    file = tmp_path / "camera.ci"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(SettingsError, match=named):
        read_calibration(file)
