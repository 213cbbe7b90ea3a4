"""The scene's scale from how the camera is mounted, where that is known."""

from __future__ import annotations

import math

import numpy as np

from heel.services.geometry.calibration_file import Calibration
from heel.services.geometry.camera import Pinhole
from heel.services.tracker.evidence.line import Line

_PERSON_M = 1.75
"""Metres: height of a usual adult in shoes; chosen by hand."""
_ROWS = 16
"""Foot rows at which the height is computed, evenly over the picture: two fix a line, more even out
that the height is not quite one; chosen by hand."""
_LOWEST_PX = 8.0
"""Working pixels: lower people stand near the horizon, where nothing can be told from clutter;
chosen by hand."""


def line_of(calibration: Calibration, shape: tuple[int, ...]) -> Line | None:
    """The height line of the middle of the picture; None where no person could stand in it.

    Args:
        calibration: of the camera.
        shape: rows and columns of the working image.
    """
    rows, columns = shape[0], shape[1]
    fov_rad = math.radians(calibration.horizontal_fov_deg)
    camera = Pinhole.from_fov(columns, rows, fov_rad).mounted(
        calibration.mount_height_m, math.radians(calibration.mount_pitch_deg)
    )
    feet = np.linspace(0.0, 1.1 * rows, _ROWS)
    heights = camera.person_height_px(
        np.stack([np.full(_ROWS, columns / 2.0), feet], axis=-1), _PERSON_M
    )
    used = np.isfinite(heights) & (heights > _LOWEST_PX)
    if used.sum() < 2:
        return None
    slope, offset = np.polyfit(feet[used], heights[used], 1, w=1.0 / heights[used])
    return Line(float(slope), float(offset))
