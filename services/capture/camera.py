"""Opens cameras: V4L2 devices by number, RTSP and HTTP streams by address."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import cv2

from schemas.errors import SourceError
from services.capture.live import LiveSource
from services.capture.quiet import silence_decoders
from services.capture.source import Warn, log_warning
from services.runtime.passwords import without_passwords

STREAM_SCHEMES = frozenset({"rtsp", "rtsps", "http", "https"})


def open_device(number: int, fps: float | None = None, warn: Warn = log_warning) -> LiveSource:
    """Open `/dev/video<number>`; the driver is asked for `fps` frames per second if given.

    Raises:
        SourceError: there is no such device, or it gives no picture.
    """
    path = Path(f"/dev/video{number}")
    if not path.exists():
        raise SourceError(f"{path}: no such camera; plug it in, or list them with ls /dev/video*")
    return LiveSource(str(path), partial(_connect_device, number, fps), warn=warn)


def open_stream(
    address: str, timeout_s: float = 3.0, warn: Warn = log_warning, open_timeout_s: float = 10.0
) -> LiveSource:
    """Open an RTSP or HTTP stream.

    Args:
        address: `rtsp://`, `rtsps://`, `http://` or `https://`; a password in it is never shown.
        timeout_s: a connection without data for so long is given up and made anew.
        warn: told of every loss and return.
        open_timeout_s: how long to wait for the first picture.

    Raises:
        SourceError: nothing answers there, or it gives no picture.
    """
    name = without_passwords(address)
    connect = partial(_connect_stream, address, name, timeout_s)
    return LiveSource(name, connect, open_timeout_s, stall_after_s=timeout_s, warn=warn)


def _connect_device(number: int, fps: float | None) -> cv2.VideoCapture:
    silence_decoders()
    capture = cv2.VideoCapture(number, cv2.CAP_V4L2)
    if not capture.isOpened():
        capture.release()
        raise SourceError("the device cannot be opened")
    if fps is not None:
        capture.set(cv2.CAP_PROP_FPS, fps)
    return capture


def _connect_stream(address: str, name: str, timeout_s: float) -> cv2.VideoCapture:
    silence_decoders()
    timeout_ms = round(timeout_s * 1000)
    parameters = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, timeout_ms]
    parameters += [cv2.CAP_PROP_READ_TIMEOUT_MSEC, timeout_ms]
    capture = cv2.VideoCapture(address, cv2.CAP_FFMPEG, parameters)
    if not capture.isOpened():
        capture.release()
        raise SourceError(f"nothing that FFmpeg can read answers at {name}")
    return capture
