"""Opens cameras: V4L2 devices by number or name, RTSP and HTTP streams by address."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from heel.schemas.errors import SourceError
from heel.services.capture.ffmpeg import open_address
from heel.services.capture.live import LiveSource
from heel.services.capture.snapshots import SnapshotDevice
from heel.services.capture.source import FrameSource, Warn, log_warning
from heel.services.capture.stream import KEY_FRAME_WAIT_S, StreamDevice
from heel.services.capture.video_device import VideoDevice, VideoDeviceFormat
from heel.services.capture.video_file import RecordedVideo
from heel.services.runtime.passwords import without_passwords

if TYPE_CHECKING:
    from av.container import InputContainer

    from heel.services.capture.device import Device

STREAM_SCHEMES = frozenset({"rtsp", "rtsps", "http", "https"})
_SLOW_READS = 2.5
"""A camera of known rate may be silent for so many periods."""
_SILENT: Warn = logging.getLogger("heel.capture.asked").debug
_RTSP_OPTIONS = {"rtsp_flags": "prefer_tcp", "allowed_media_types": "video"}


def open_device(
    path: Path, wanted: VideoDeviceFormat | None = None, warn: Warn = log_warning,
    stop: threading.Event | None = None,
) -> LiveSource:  # fmt: skip
    """Open a V4L2 camera; what it gives in place of what was asked for is told to `warn`.

    Raises:
        SourceError: there is no such device, or it gives no picture.
    """
    if not path.exists():
        raise SourceError(f"{path}: no such camera; plug it in, or list them with ls /dev/video*")
    connect = partial(VideoDevice, path, wanted or VideoDeviceFormat(), warn)
    return LiveSource(str(path), connect, warn=warn, stop=stop)


def open_stream(
    address: str,
    timeout_s: float = 3.0,
    warn: Warn = log_warning,
    open_timeout_s: float = 10.0,
    fps: float | None = None,
    stop: threading.Event | None = None,
) -> FrameSource:
    """Open an RTSP or HTTP address: a live stream, or a recording that a server holds.

    What has a length is a recording and is played once, like a file; a single picture is fetched
    again and again.

    Args:
        address: `rtsp://`, `rtsps://`, `http://` or `https://`; a password in it is never shown.
        timeout_s: a connection without data for so long is given up and made anew.
        warn: told of every loss and return.
        open_timeout_s: how long to wait for the first picture; for the first key frame of a stream
            that sends data, up to 30 s.
        fps: rate of a camera that is known to be slow; the time-out is no shorter than 2.5 periods.
        stop: ends the opening at once.

    Raises:
        SourceError: nothing answers there, it wants a password, or it gives no picture.
    """
    name = without_passwords(address)
    scheme, separator, rest = address.partition("://")
    address = scheme.lower() + separator + rest
    is_rtsp = scheme.lower().startswith("rtsp")
    timeout_s = max(timeout_s, _SLOW_READS / fps if fps else 0.0)
    options: Mapping[str, str] = _RTSP_OPTIONS if is_rtsp else {}
    connect = partial(open_address, address, name, timeout_s, options)
    container = _opened(connect, name, stop)
    kind = container.format.name
    if not is_rtsp and (kind.startswith("image2") or kind.endswith("_pipe")):
        return LiveSource(
            name, partial(SnapshotDevice, connect, name, fps), open_timeout_s,
            stall_after_s=timeout_s, warn=warn, stop=stop,
        )  # fmt: skip
    # The size of a playlist says nothing of the length of what it lists.
    whole = kind != "hls" and container.size > 0
    if not is_rtsp and (whole or (container.duration or 0) > 0):
        return RecordedVideo(container, name, warn, read_timeout_s=timeout_s, stop=stop)
    first = [container]

    def connect_again() -> Device:
        return StreamDevice(first.pop() if first else connect(), name)

    return LiveSource(
        name, connect_again, open_timeout_s, stall_after_s=timeout_s, warn=warn, stop=stop,
        patience_s=KEY_FRAME_WAIT_S,
    )  # fmt: skip


def holds_recording(address: str) -> bool:
    """Whether a recording is to be had at an address; False where nothing answers as well."""
    try:
        with open_stream(address, warn=_SILENT) as source:
            return not source.is_live
    except SourceError:
        return False


def _opened(
    connect: Callable[[], InputContainer], name: str, stop: threading.Event | None
) -> InputContainer:
    """Open in a thread of its own, which may be left behind: FFmpeg cannot be interrupted."""
    results: queue.SimpleQueue[InputContainer | SourceError] = queue.SimpleQueue()
    abandoned = threading.Event()

    def work() -> None:
        try:
            container = connect()
        except SourceError as error:
            results.put(error)
            return
        if abandoned.is_set():
            container.close()
        results.put(container)

    threading.Thread(target=work, name="camera-opener", daemon=True).start()
    started_s = time.monotonic()
    while stop is None or not stop.is_set():
        with suppress(queue.Empty):
            result = results.get(timeout=0.05)
            if isinstance(result, SourceError):
                raise result
            return result
    abandoned.set()
    waited_s = time.monotonic() - started_s
    raise SourceError(f"{name}: no picture within {waited_s:.1f} s, when told to end")
