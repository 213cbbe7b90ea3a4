"""What capture says of its camera: from its settings and the calibration file."""

from __future__ import annotations

import math
from dataclasses import dataclass

from heel.services.capture.settings import CaptureSettings
from heel.services.geometry.calibration_file import read_calibration


@dataclass(frozen=True, slots=True)
class Mounting:
    """The fields of `CameraInfo` that frames do not tell; None: not known."""

    horizontal_fov_rad: float | None
    mount_height_m: float | None
    mount_pitch_rad: float | None


def mounting(settings: CaptureSettings, own_fov_rad: float | None = None) -> Mounting:
    """How the camera is mounted; single settings win over the calibration file.

    Args:
        settings: of the capture process.
        own_fov_rad: what the source knows of its field of view; wins over both.

    Raises:
        SettingsError: the calibration file cannot be used.
    """
    fov_deg, pitch_deg = settings.horizontal_fov_deg, settings.mount_pitch_deg
    height_m = settings.mount_height_m
    if settings.calibration is not None:
        file = read_calibration(settings.calibration)
        fov_deg = file.horizontal_fov_deg if fov_deg is None else fov_deg
        height_m = file.mount_height_m if height_m is None else height_m
        pitch_deg = file.mount_pitch_deg if pitch_deg is None else pitch_deg
    stated_rad = None if fov_deg is None else math.radians(fov_deg)
    return Mounting(
        stated_rad if own_fov_rad is None else own_fov_rad,
        height_m,
        None if pitch_deg is None else math.radians(pitch_deg),
    )
