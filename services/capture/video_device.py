"""A USB or built-in camera, through OpenCV's V4L2 reader, which keeps a deadline on every read."""

from __future__ import annotations

import os
import re
import time
from dataclasses import dataclass
from pathlib import Path

import cv2

from heel.schemas.errors import SourceError
from heel.services.capture.arrivals import CountedArrivals
from heel.services.capture.device import Picture
from heel.services.capture.source import Warn, log_warning
from heel.services.geometry.pixels import to_bgr8
from heel.services.runtime.quiet import silence_decoders

_PLAUSIBLE_S = 60.0
"""A driver's time stamp within this of our clock is on our clock."""


@dataclass(frozen=True)
class VideoDeviceFormat:
    """What a V4L2 device is asked for; None leaves the driver's choice.

    Attributes:
        width: pixels.
        height: pixels.
        fps: frames per second.
        fourcc: four letters of the pixel format, `MJPG` for many frames per second over USB.
    """

    width: int | None = None
    height: int | None = None
    fps: float | None = None
    fourcc: str | None = None


class VideoDevice:
    """An open V4L2 device.

    Args:
        path: any name of the character device, a link in `/dev/v4l/by-id` too.
        wanted: asked for before the first picture.
        warn: told once what the driver gives in place of what was asked for.

    Raises:
        SourceError: the device cannot be opened.
    """

    def __init__(self, path: Path, wanted: VideoDeviceFormat, warn: Warn = log_warning) -> None:
        silence_decoders()
        self.complaint = ""
        number = device_number(path)
        if number is None:
            raise SourceError("not a V4L2 camera; list them with ls -l /dev/v4l/by-id")
        self._capture = cv2.VideoCapture(number, cv2.CAP_V4L2)
        if not self._capture.isOpened():
            self._capture.release()
            raise SourceError("the device cannot be opened")
        given = _negotiate(self._capture, wanted)
        self.fps = given.fps or 0.0
        for line in differences(wanted, given):
            warn(f"{path}: {line}")
        self._counts = CountedArrivals()

    def read(self) -> Picture:
        """Block for the next picture; see `Device`."""
        done, picture = self._capture.read()
        now_ns = time.monotonic_ns()
        if not done:
            raise SourceError("the camera stopped delivering pictures")
        counted_s = self._counts.late_s(now_ns * 1e-9)
        # The driver's own time stamp, of the monotonic clock with nearly every driver: it tells
        # what waited in its buffers.
        stamped_s = now_ns * 1e-9 - float(self._capture.get(cv2.CAP_PROP_POS_MSEC)) / 1000.0
        late_s = stamped_s if 0.0 <= stamped_s < _PLAUSIBLE_S else counted_s
        return Picture(to_bgr8(picture), now_ns - round(late_s * 1e9))

    def interrupt(self) -> None:
        """Nothing: OpenCV's reader ends by its own deadline of 10 s."""

    def close(self) -> None:
        """Release the device."""
        self._capture.release()


def device_number(path: Path) -> int | None:
    """N of the `/dev/videoN` that a name, or a link to one, stands for; None for anything else."""
    for name in (path, Path(os.path.realpath(path))):
        if found := re.fullmatch(r"/dev/video(\d{1,4})", str(name)):
            return int(found.group(1))
    # A node of another name is known by its device number: /dev/cam -> 81:N.
    try:
        status = path.stat()
        event = Path(f"/sys/dev/char/{os.major(status.st_rdev)}:{os.minor(status.st_rdev)}/uevent")
        found = re.search(r"^DEVNAME=video(\d{1,4})$", event.read_text(), re.MULTILINE)
    except OSError:
        return None
    return int(found.group(1)) if found else None


def differences(wanted: VideoDeviceFormat, given: VideoDeviceFormat) -> list[str]:
    """One line for everything that was asked for and not given."""
    lines = []
    if wanted.width or wanted.height:
        size = (wanted.width or given.width, wanted.height or given.height)
        if size != (given.width, given.height):
            lines.append(f"gives {given.width}x{given.height} in place of {size[0]}x{size[1]}")
    if wanted.fps and given.fps and abs(given.fps - wanted.fps) > 0.01 * wanted.fps:
        lines.append(f"gives {given.fps:g} frames/s in place of {wanted.fps:g}")
    if wanted.fourcc and given.fourcc != wanted.fourcc:
        lines.append(f"gives pixel format {given.fourcc} in place of {wanted.fourcc}")
    if lines:
        lines[-1] += "; v4l2-ctl --list-formats-ext shows what the camera has"
    return lines


def _negotiate(capture: cv2.VideoCapture, wanted: VideoDeviceFormat) -> VideoDeviceFormat:
    # The pixel format first: it decides which sizes and rates there are.
    if wanted.fourcc is not None:
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*wanted.fourcc))
    for key, value in (
        (cv2.CAP_PROP_FRAME_WIDTH, wanted.width),
        (cv2.CAP_PROP_FRAME_HEIGHT, wanted.height),
        (cv2.CAP_PROP_FPS, wanted.fps),
    ):
        if value is not None:
            capture.set(key, value)
    code = int(capture.get(cv2.CAP_PROP_FOURCC))
    fourcc = "".join(chr(code >> shift & 0xFF) for shift in (0, 8, 16, 24))
    return VideoDeviceFormat(
        width=int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)),
        height=int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)),
        fps=float(capture.get(cv2.CAP_PROP_FPS)) or None,
        fourcc=fourcc if fourcc.isprintable() else None,
    )
