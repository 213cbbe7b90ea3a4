"""The window of a virtual pan: the part of a wide picture that a turning camera would show."""

from __future__ import annotations

import math
from collections import OrderedDict
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from heel.schemas.errors import SourceError

_REMEMBERED_FRAMES = 256
"""Frames whose window is remembered: more than tracks may be behind."""
_WHOLE_PIXEL = 1.0 / 32.0
"""warpAffine resolves no finer fractions of a pixel."""
_TILT_GAIN_PER_S = 2.0
"""Tilt speed by the person's offset from the middle, 1/s; chosen by hand."""
_TILT_DEADBAND_RAD = 0.03
"""Offset that is left alone: boxes scatter by so much."""


class PanSettings(BaseModel):
    """What can be chosen about a virtual pan after the `?` of `pan:PATH?...`."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    width: int | None = Field(
        default=None, ge=16, le=8192, description="of the window, pixels; half the recording's"
    )
    height: int | None = Field(
        default=None, ge=16, le=8192, description="of the window, pixels; half the recording's"
    )
    fov_deg: float = Field(
        default=60.0, gt=5, lt=175, description="horizontal field of view of the window, degrees"
    )
    x: float | None = Field(
        default=None, ge=0, description="column of the recording in the middle at the start"
    )
    y: float | None = Field(
        default=None, ge=0, description="row of the recording in the middle at the start"
    )
    tilt_radps: float = Field(
        default=1.0, ge=0, le=10, description="fastest tilt towards the person; 0: no tilt"
    )
    window_file: Path | None = Field(
        default=None, description="CSV: where the window lay in every frame"
    )


class PanWindow:
    """A pinhole camera that turns before the picture plane of a recording.

    The window keeps the recording's scale. Its focal length follows from its width and field of
    view; its centre lies `f * tan(yaw)` left of the recording's and `f * tan(pitch)` below it,
    and the window stays within the recording: angles end where it touches a border. The same
    turns give the same windows.

    Args:
        recording_size: (width, height) of the pictures given to `view`.
        settings: size, field of view, start and tilt.

    Raises:
        SourceError: the window does not fit into the recording, or starts outside.
    """

    def __init__(self, recording_size: tuple[int, int], settings: PanSettings) -> None:
        across, down = recording_size
        self._recording_size = recording_size
        self.width = settings.width or max(1, across // 2)
        self.height = settings.height or max(1, down // 2)
        if self.width > across or self.height > down:
            raise SourceError(
                f"window of {self.width}x{self.height} in a recording of {across}x{down}: "
                "give a smaller width and height"
            )
        x, y = settings.x, settings.y
        if (x is not None and x > across) or (y is not None and y > down):
            raise SourceError(
                f"start x={x}, y={y} outside a recording of {across}x{down}: give pixels inside"
            )
        self.fov_rad = math.radians(settings.fov_deg)
        self.focal_px = self.width / (2.0 * math.tan(self.fov_rad / 2.0))
        self._most_yaw_rad = math.atan((across - self.width) / 2.0 / self.focal_px)
        self._most_pitch_rad = math.atan((down - self.height) / 2.0 / self.focal_px)
        self._most_tilt_radps = settings.tilt_radps
        self.yaw_rad = self._yaw(0.0 if x is None else math.atan((across / 2 - x) / self.focal_px))
        self.pitch_rad = self._pitch(
            0.0 if y is None else math.atan((y - down / 2) / self.focal_px)
        )
        self._offsets: OrderedDict[int, tuple[float, float]] = OrderedDict()

    @property
    def offset_px(self) -> tuple[float, float]:
        """(left, top) of the window now, recording pixels, on a grid of 1/32."""
        across, down = self._recording_size
        left = (across - self.width) / 2.0 - self.focal_px * math.tan(self.yaw_rad)
        top = (down - self.height) / 2.0 + self.focal_px * math.tan(self.pitch_rad)
        return _on_grid(left, across - self.width), _on_grid(top, down - self.height)

    def turn(self, angular_radps: float, dt_s: float) -> None:
        """Pan for `dt_s` seconds; left is positive, as for the robot."""
        self.yaw_rad = self._yaw(self.yaw_rad + angular_radps * dt_s)

    def tilt_towards(self, row_px: float, dt_s: float) -> None:
        """Bring a row of the recording towards the middle of the window, at a bounded rate.

        Proportional with a deadband, like the follower's turning, so that a box that trembles
        does not shake the picture.
        """
        middle_px = self.offset_px[1] + self.height / 2.0
        error_rad = math.atan((row_px - middle_px) / self.focal_px)
        error_rad = math.copysign(max(0.0, abs(error_rad) - _TILT_DEADBAND_RAD), error_rad)
        most = self._most_tilt_radps
        rate = min(max(_TILT_GAIN_PER_S * error_rad, -most), most)
        # A step that is long for the gain must not overshoot.
        step_rad = min(abs(rate) * dt_s, abs(error_rad))
        self.pitch_rad = self._pitch(self.pitch_rad + math.copysign(step_rad, rate))

    def view(self, image: NDArray[np.uint8], index: int) -> NDArray[np.uint8]:
        """The window (height, width, 3) of a picture of the recording, kept as frame `index`."""
        left, top = offset = self.offset_px
        self._offsets[index] = offset
        if len(self._offsets) > _REMEMBERED_FRAMES:
            self._offsets.popitem(last=False)
        if left == int(left) and top == int(top):
            rows, columns = slice(int(top), int(top) + self.height), int(left)
            return np.ascontiguousarray(image[rows, columns : columns + self.width])
        moved = cv2.warpAffine(
            image, np.array([[1.0, 0.0, left], [0.0, 1.0, top]]), (self.width, self.height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderMode=cv2.BORDER_REPLICATE,
        )  # fmt: skip
        return np.asarray(moved, np.uint8)

    def offset_of(self, index: int) -> tuple[float, float] | None:
        """(left, top) of the window in a frame, None if it is long ago or was never shown."""
        return self._offsets.get(index)

    def _yaw(self, angle_rad: float) -> float:
        return min(max(angle_rad, -self._most_yaw_rad), self._most_yaw_rad)

    def _pitch(self, angle_rad: float) -> float:
        return min(max(angle_rad, -self._most_pitch_rad), self._most_pitch_rad)


def _on_grid(offset_px: float, most_px: int) -> float:
    return min(max(round(offset_px / _WHOLE_PIXEL) * _WHOLE_PIXEL, 0.0), float(most_px))
