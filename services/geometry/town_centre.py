"""Calibration files of the Town Centre data set: `Name = value` lines, lengths in metres.

Published with B. Benfold & I. Reid, "Stable multi-target tracking in real-time surveillance video",
CVPR 2011: focal length and principal point in pixels, the world's rotation into the camera as a
quaternion, and its translation; the ground is z = 0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

_NAMES = (
    "FocalLengthX", "PrincipalPointX", "TranslationX", "TranslationY", "TranslationZ",
    "RotationX", "RotationY", "RotationZ", "RotationW",
)  # fmt: skip


def mounting_of(text: str) -> tuple[float, float, float]:
    """Height in metres, pitch in degrees (down is positive) and horizontal field of view.

    Roll (1.3 degrees on Town Centre) and lens distortion (4 pixels of 1920 there) are left out.

    Raises:
        ValueError: a value is missing or no number.
    """
    values = _values(text)
    x, y, z, w = (values[f"Rotation{name}"] for name in "XYZW")
    # Third column of the rotation matrix: where the world's up points in the camera.
    up = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    up /= x * x + y * y + z * z + w * w
    translation = np.array([values[f"Translation{name}"] for name in "XYZ"])
    height_m = -float(up @ translation)
    width_px = 2.0 * values["PrincipalPointX"] + 1.0
    fov_rad = 2.0 * math.atan(width_px / (2.0 * values["FocalLengthX"]))
    return height_m, math.degrees(math.asin(-up[2])), math.degrees(fov_rad)


def _values(text: str) -> Mapping[str, float]:
    values = {}
    for line in text.splitlines():
        name, _, value = line.partition("=")
        if name.strip() in _NAMES:
            values[name.strip()] = float(value)
    missing = [name for name in _NAMES if name not in values]
    if missing:
        raise ValueError(f"{missing[0]} is missing")
    return values
