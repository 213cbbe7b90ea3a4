"""What capture says of its camera: from its settings and the calibration file."""

from __future__ import annotations

import math
from dataclasses import dataclass

from heel.schemas import CameraInfo
from heel.schemas.frame import LensModel
from heel.services.capture.settings import CaptureSettings
from heel.services.geometry.calibration_file import read_calibration
from heel.services.geometry.camera import Pinhole
from heel.services.geometry.lens import Lens
from heel.services.geometry.lens_file import LensFile, read_lens


@dataclass(frozen=True, slots=True)
class Mounting:
    """What frames do not tell of their camera; None: not known.

    Attributes:
        stated_fov_rad: horizontal field of view, where no lens tells it.
        mount_height_m, mount_pitch_rad, mount_yaw_rad: as of `CameraInfo`.
        lens_file: the lens.
    """

    stated_fov_rad: float | None
    mount_height_m: float | None
    mount_pitch_rad: float | None
    lens_file: LensFile | None = None
    mount_yaw_rad: float | None = None

    def horizontal_fov_rad(self, width_px: int, height_px: int) -> float | None:
        """Of pictures of that size, by the lens where there is one.

        Raises:
            SettingsError: the file's pictures have another shape.
        """
        if self.lens_file is None:
            return self.stated_fov_rad
        lens = self.lens_file.at(width_px, height_px)
        return Pinhole.through(lens, width_px, height_px).horizontal_fov_rad

    def lens(self, width_px: int, height_px: int) -> LensModel | None:
        """The lens for pictures of that size.

        Raises:
            SettingsError: the file's pictures have another shape.
        """
        file = self.lens_file
        return None if file is None else file.at(width_px, height_px).model()


def mounting(settings: CaptureSettings, own_fov_rad: float | None = None) -> Mounting:
    """How the camera is mounted; single settings win over the calibration file.

    Args:
        settings: of the capture process.
        own_fov_rad: what the source knows of its field of view; wins over both.

    Raises:
        SettingsError: the calibration file or that of the lens cannot be used.
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
        None if settings.lens is None else read_lens(settings.lens),
        None if settings.mount_yaw_deg is None else math.radians(settings.mount_yaw_deg),
    )


def completed(own: Mounting, recorded: CameraInfo | None) -> Mounting:
    """The same camera with what was recorded of it, if anything was, in place of what is not known.

    Args:
        own: by the settings, which win: a stated field of view also over a recorded lens.
        recorded: what the camera said of itself then.
    """
    if recorded is None:
        return own
    fov_rad, lens = own.stated_fov_rad, own.lens_file
    if fov_rad is None and lens is None:
        fov_rad = recorded.horizontal_fov_rad
        if recorded.lens is not None:
            lens = LensFile(recorded.width, recorded.height, Lens.told(recorded.lens))
    height_m, pitch_rad, yaw_rad = own.mount_height_m, own.mount_pitch_rad, own.mount_yaw_rad
    return Mounting(
        fov_rad,
        recorded.mount_height_m if height_m is None else height_m,
        recorded.mount_pitch_rad if pitch_rad is None else pitch_rad,
        lens,
        recorded.mount_yaw_rad if yaw_rad is None else yaw_rad,
    )
