"""Files that describe a lens: ROS `camera_info` YAML, OpenCV's calibration YAML, Kalibr's camchain.

`heel calibrate board` writes the first of them, which every ROS tool reads.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from heel.schemas import SettingsError
from heel.services.geometry.lens import Lens

_MOST_BYTES = 1 << 20
"""Of a file: those of cameras have a few hundred; chosen by hand."""
_SHAPE_TOLERANCE = 0.02
"""Relative difference of width by height between the file's picture and another one: rounding of
sizes; beyond it the picture was cut, and the file is of no use. Chosen by hand."""
_BROWN = ("plumb_bob", "rational_polynomial", "radtan", "none", "")
_FISHEYE = ("equidistant", "fisheye")


@dataclass(frozen=True, slots=True)
class LensFile:
    """A lens and the size of the pictures that it was measured with, pixels."""

    width_px: int
    height_px: int
    lens: Lens

    def at(self, width_px: int, height_px: int) -> Lens:
        """The lens for pictures of another size.

        Raises:
            SettingsError: they have another shape, so that they are cut.
        """
        across, down = width_px / self.width_px, height_px / self.height_px
        if not math.isclose(across, down, rel_tol=_SHAPE_TOLERANCE):
            raise SettingsError(
                f"lens of pictures of {self.width_px}x{self.height_px} for pictures of "
                f"{width_px}x{height_px}: they have another shape: calibrate at this shape, or ask "
                "the camera for that one"
            )
        return self.lens.scaled(across, down)


class _Loader(yaml.SafeLoader):
    """Safe YAML, and OpenCV's matrices as the mappings that they are."""


def _matrix(loader: yaml.SafeLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    return loader.construct_mapping(node, deep=True)


_Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", _matrix)


def read_lens(file: Path) -> LensFile:
    """Read a lens file of any of these kinds.

    Raises:
        SettingsError: unreadable, of no such kind, a value that is missing or none, or a model that
            does not hold as far as the picture's rim.
    """
    try:
        with file.open(encoding="utf-8") as stream:
            text = stream.read(_MOST_BYTES + 1)
    except OSError as error:
        raise SettingsError(f"lens file {file}: {error.strerror}: check the path") from None
    except UnicodeDecodeError as error:
        raise SettingsError(f"lens file {file} is no text: {error}") from None
    if len(text) > _MOST_BYTES:
        raise SettingsError(f"lens file {file}: longer than {_MOST_BYTES} characters: is it one?")
    if text.startswith("%YAML"):  # OpenCV's first line is none of YAML's
        text = text.partition("\n")[2]
    try:
        found = _of(yaml.load(text, _Loader))
    except yaml.YAMLError as error:
        raise SettingsError(f"lens file {file} is not YAML: {error}") from None
    except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
        raise SettingsError(
            f"lens file {file}: {error}: give a file of ROS (camera_info), OpenCV or Kalibr, or "
            "make one with `heel calibrate board`"
        ) from None
    if not found.lens.covers(found.width_px, found.height_px):
        raise SettingsError(
            f"lens file {file}: the distortion does not hold as far as the picture's rim: "
            "calibrate with the board in all corners, or as a fisheye"
        )
    return found


def write_lens(file: Path, found: LensFile, name: str) -> None:
    """Write a ROS `camera_info` file.

    Raises:
        SettingsError: the file cannot be written.
    """
    (focal_x, focal_y), (x, y) = found.lens.focal_px, found.lens.centre_px
    wanted = 4 if found.lens.fisheye else 5
    coefficients = [*found.lens.coefficients, *[0.0] * wanted]
    matrix = [focal_x, 0.0, x, 0.0, focal_y, y, 0.0, 0.0, 1.0]
    told = {
        "image_width": found.width_px, "image_height": found.height_px, "camera_name": name,
        "camera_matrix": {"rows": 3, "cols": 3, "data": matrix},
        "distortion_model": "equidistant" if found.lens.fisheye else "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": wanted, "data": coefficients[:wanted]},
        "rectification_matrix": {
            "rows": 3, "cols": 3, "data": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        },
        "projection_matrix": {
            "rows": 3, "cols": 4,
            "data": [focal_x, 0.0, x, 0.0, 0.0, focal_y, y, 0.0, 0.0, 0.0, 1.0, 0.0],
        },
    }  # fmt: skip
    try:
        file.write_text(yaml.safe_dump(told, sort_keys=False), encoding="utf-8")
    except OSError as error:
        raise SettingsError(f"lens file {file}: {error.strerror}: check the path") from None


def _of(told: Any) -> LensFile:
    if not isinstance(told, dict):
        raise ValueError("no mapping")
    chain = sorted(name for name in told if str(name).startswith("cam") and "_" not in str(name))
    if chain and isinstance(told[chain[0]], dict):
        return _of_kalibr(told[chain[0]])
    matrix = _numbers(told["camera_matrix"], "camera_matrix", 9)
    name = "distortion_coefficients" if "distortion_coefficients" in told else "dist_coeffs"
    coefficients = _numbers(told[name], name)
    model = str(told.get("distortion_model", "equidistant" if told.get("fisheye_model") else ""))
    return _made(
        told["image_width"], told["image_height"], (matrix[0], matrix[4], matrix[2], matrix[5]),
        model, coefficients,
    )  # fmt: skip


def _of_kalibr(camera: dict[str, Any]) -> LensFile:
    if camera.get("camera_model", "pinhole") != "pinhole":
        raise ValueError(f"camera_model {camera['camera_model']} is not read: pinhole is")
    focal_x, focal_y, x, y = _numbers(camera["intrinsics"], "intrinsics", 4)
    width, height = camera["resolution"]
    model = str(camera.get("distortion_model", "none"))
    coefficients = _numbers(camera.get("distortion_coeffs", []), "distortion_coeffs")
    return _made(width, height, (focal_x, focal_y, x, y), model, coefficients)


def _made(
    width: Any, height: Any, projection: tuple[float, ...], model: str, coefficients: list[float]
) -> LensFile:
    if model not in (*_BROWN, *_FISHEYE):
        raise ValueError(f"distortion model {model} is not read: plumb_bob and equidistant are")
    focal_x, focal_y, x, y = projection
    width, height = int(width), int(height)
    if width <= 0 or height <= 0 or focal_x <= 0 or focal_y <= 0:
        raise ValueError(f"{width}x{height} pixels, focal lengths {focal_x:g} and {focal_y:g}")
    if not (0 < x < width and 0 < y < height):
        raise ValueError(f"principal point {x:g}, {y:g} outside {width}x{height} pixels")
    most = 4 if model in _FISHEYE else 8
    if any(coefficients[most:]):
        raise ValueError(f"{len(coefficients)} distortion coefficients, {most} are read")
    lens = Lens(model in _FISHEYE, (focal_x, focal_y), (x, y), tuple(coefficients[:most]))
    return LensFile(width, height, lens)


def _numbers(told: Any, name: str, count: int | None = None) -> list[float]:
    """The finite numbers of a list, or of a matrix's `data`."""
    values = [float(value) for value in (told["data"] if isinstance(told, dict) else told)]
    if count is not None and len(values) != count:
        raise ValueError(f"{name} has {len(values)} numbers, not {count}")
    if not all(math.isfinite(value) for value in values):
        raise ValueError(f"{name} holds a number that is not finite")
    return values
