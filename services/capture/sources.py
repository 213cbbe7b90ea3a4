"""From what a user types (a path, an address, a camera number, a scene) to an open source."""

from __future__ import annotations

import os
import re
import stat
import threading
from dataclasses import replace
from functools import partial
from pathlib import Path

from heel.schemas.errors import SourceError
from heel.services.capture.adjust import AdjustedSource, LoopedSource, check_adjustment
from heel.services.capture.camera import STREAM_SCHEMES, open_device, open_stream
from heel.services.capture.ffmpeg import shown_path
from heel.services.capture.image_folder import IMAGE_SUFFIXES, ImageFolderSource, list_images
from heel.services.capture.recording import (
    CAMERA_OPTION,
    bag_in,
    names_recording,
    open_recording,
)
from heel.services.capture.scene_source import SCENE_PREFIX, open_scene
from heel.services.capture.sequence import open_sequence
from heel.services.capture.source import FrameSource, Warn, log_warning
from heel.services.capture.video_device import VideoDeviceFormat
from heel.services.capture.video_file import VideoFileSource
from heel.services.capture.virtual_pan import PAN_PREFIX, open_pan
from heel.services.runtime.passwords import without_passwords
from heel.services.sequence_file import sequence_file

_DEVICE = re.compile(r"(?:/dev/video)?(\d{1,4})")
_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://")


def open_source(
    spec: str,
    *,
    scale: float = 1.0,
    fps: float | None = None,
    loop: bool = False,
    warn: Warn = log_warning,
    camera: VideoDeviceFormat | None = None,
    stop: threading.Event | None = None,
) -> FrameSource:
    """Open whatever `spec` names.

    Args:
        spec: a video file, a recording of `heel record`, a picture, a folder of pictures, a
            MOTChallenge sequence directory, `/dev/videoN`, `N` or any other name of a camera's
            device, an `rtsp://` or `http://`
            address (and their TLS forms), `scene:NAME?seed=1&people=6&frames=400`, or a window of
            a recording that turns:
            `pan:PATH?width=384&height=288`.
        scale: factor for both sides of every frame, in (0, 1].
        fps: rate to use in place of the source's own, in (0, 240].
        loop: play a recording again and again; a camera is endless as it is.
        warn: told in one line of every defect that does not end the stream.
        camera: what a camera at `/dev/videoN` is asked for; `fps` goes with it.
        stop: ends the opening of a camera or an address at once.

    Raises:
        SourceError: `spec` names nothing that can be read; the message says what to do.
    """
    check_adjustment(scale, fps)
    device = _DEVICE.fullmatch(spec)
    scheme = _SCHEME.match(spec)
    source: FrameSource
    if spec.startswith(PAN_PREFIX):
        # The rate is the recording's: the pan plays it like a camera that cannot be slowed down.
        source = open_pan(spec, partial(open_source, fps=fps, loop=loop, warn=warn))
        fps = None
    elif device or _is_device(spec):
        path = Path(f"/dev/video{device.group(1)}" if device else spec)
        wanted = replace(camera or VideoDeviceFormat(), fps=fps)
        source = open_device(path, wanted, warn, stop)
    elif scheme:
        if scheme.group(1).lower() not in STREAM_SCHEMES:
            raise SourceError(
                f"{without_passwords(spec)}: cannot read {scheme.group(1)}://; "
                f"give one of {', '.join(sorted(STREAM_SCHEMES))}, a path or scene:demo"
            )
        reopen = partial(open_stream, spec, warn=warn, fps=fps, stop=stop)
        source = reopen()
        if loop and not source.is_live:
            source.close()
            source = LoopedSource(reopen)
    else:
        reopen = partial(_open_recording, spec, warn)
        source = LoopedSource(reopen) if loop else reopen()
    if scale == 1.0 and fps is None:
        return source
    return AdjustedSource(source, scale, fps)


def _is_device(spec: str) -> bool:
    """Whether a path names a character device, which a camera is."""
    try:
        return stat.S_ISCHR(os.stat(spec).st_mode)
    except (OSError, ValueError):
        # A camera that is not plugged in has no node, but where one would be is a camera's place.
        return spec.startswith(("/dev/video", "/dev/v4l/"))


def _is_animated(path: Path) -> bool:
    """Whether a PNG holds more than one picture: its animation chunk precedes the first."""
    try:
        with path.open("rb") as file:
            return path.suffix.lower() == ".png" and b"acTL" in file.read(4096)
    except OSError:
        return False


def _open_recording(spec: str, warn: Warn) -> FrameSource:
    if spec.startswith(SCENE_PREFIX):
        return open_scene(spec)
    path = Path(spec)
    if names_recording(spec) and not os.path.isdir(path):
        return open_recording(spec, warn)
    folder, mark, camera = spec.partition(CAMERA_OPTION)
    if mark and os.path.isdir(folder) and (bag := bag_in(Path(folder))) is not None:
        return open_recording(f"{bag}{mark}{camera}", warn)
    if spec and os.path.isdir(path):
        if sequence_file(path) is not None:
            return open_sequence(path, warn)
        if (bag := bag_in(path)) is not None:
            return open_recording(str(bag), warn)
        return ImageFolderSource(list_images(path), shown_path(path), warn=warn)
    # os.path takes a name that is too long or forbidden for one that is not there; pathlib raises.
    if not spec or not os.path.exists(path):
        raise SourceError(
            f"{without_passwords(shown_path(Path(spec)))!r}: no such file or folder; give a path, "
            "/dev/videoN, an rtsp:// or http:// "
            "address, or scene:demo"
        )
    if path.suffix.lower() in IMAGE_SUFFIXES and path.stat().st_size and not _is_animated(path):
        return ImageFolderSource([path], shown_path(path), warn=warn)
    return VideoFileSource(path, warn)
