"""Files of lenses: three kinds in, one out, and what is refused with a remedy."""

from __future__ import annotations

from pathlib import Path

import pytest

from heel.schemas import SettingsError
from heel.services.geometry.lens import Lens
from heel.services.geometry.lens_file import LensFile, read_lens, write_lens

ROS = """
image_width: 640
image_height: 480
camera_name: front
camera_matrix: {rows: 3, cols: 3, data: [500.0, 0, 321.5, 0, 501.0, 239.0, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.2, 0.05, 0.001, -0.001, 0.0]}
"""
OPENCV = """%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 321.5, 0., 501., 239., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.2, 0.05, 0.001, -0.001, 0. ]
"""
KALIBR = """
cam0:
  camera_model: pinhole
  intrinsics: [500.0, 501.0, 321.5, 239.0]
  distortion_model: radtan
  distortion_coeffs: [-0.2, 0.05, 0.001, -0.001]
  resolution: [640, 480]
  rostopic: /front
"""
FOCAL, CENTRE = (500.0, 501.0), (321.5, 239.0)


@pytest.mark.parametrize("text", [ROS, OPENCV, KALIBR], ids=["ros", "opencv", "kalibr"])
def test_three_kinds_of_files_say_the_same(text: str, tmp_path: Path) -> None:
    file = tmp_path / "lens.yaml"
    file.write_text(text)
    found = read_lens(file)
    assert (found.width_px, found.height_px) == (640, 480)
    assert (found.lens.fisheye, found.lens.focal_px, found.lens.centre_px) == (False, FOCAL, CENTRE)
    assert found.lens.coefficients[:4] == (-0.2, 0.05, 0.001, -0.001)
    assert not any(found.lens.coefficients[4:])


@pytest.mark.parametrize("fisheye", [False, True])
def test_what_is_written_is_read_again(fisheye: bool, tmp_path: Path) -> None:
    lens = Lens(fisheye, FOCAL, CENTRE, (-0.02, 0.005, 0.0001, 0.0002))
    write_lens(tmp_path / "lens.yaml", LensFile(640, 480, lens), "front")
    found = read_lens(tmp_path / "lens.yaml")
    assert found.lens.model().model_dump(exclude={"coefficients"}) == lens.model().model_dump(
        exclude={"coefficients"}
    )
    assert found.lens.coefficients[:4] == lens.coefficients


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no mapping"),
        ("]", "is not YAML"),
        ("!!python/object/apply:os.system ['true']", "is not YAML"),
        (ROS.replace("500.0", ".nan"), "not finite"),
        (ROS.replace("500.0, 0, ", ""), "7 numbers, not 9"),
        (ROS.replace("image_width: 640", "image_width: 0"), "0x480 pixels"),
        (ROS.replace("321.5", "900"), "principal point 900"),
        (ROS.replace("plumb_bob", "thin_prism"), "thin_prism is not read"),
        (ROS.replace("-0.2, 0.05", "-1.5, 0.9"), "does not hold as far as the picture's rim"),
        (KALIBR.replace("pinhole", "omni"), "omni is not read"),
        (ROS.replace("image_height", "height"), "image_height"),
    ],
)
def test_what_is_no_lens_is_refused_by_name(text: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "lens.yaml"
    file.write_text(text)
    with pytest.raises(SettingsError, match=words) as refused:
        read_lens(file)
    assert "lens.yaml" in str(refused.value)


def test_a_missing_or_huge_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="check the path"):
        read_lens(tmp_path / "none.yaml")
    (tmp_path / "huge.yaml").write_text("#" * ((1 << 20) + 1))
    with pytest.raises(SettingsError, match="longer than"):
        read_lens(tmp_path / "huge.yaml")


def test_pictures_of_another_size_scale_and_of_another_shape_are_refused() -> None:
    found = LensFile(640, 480, Lens(False, FOCAL, CENTRE))
    half = found.at(320, 240)
    assert (half.focal_px, half.centre_px) == ((250.0, 250.5), (160.75, 119.5))
    with pytest.raises(SettingsError, match="another shape"):
        found.at(640, 360)
