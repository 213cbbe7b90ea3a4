"""Opens files and addresses with FFmpeg, and says in Heel's words why one cannot be opened."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import av
import av.error

from heel.schemas.errors import SourceError
from heel.schemas.image import MAX_IMAGE_PIXELS
from heel.services.runtime.passwords import ESCAPES, may_hold_unescaped

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.video.stream import VideoStream

CONVERT = "convert it with: ffmpeg -i IN -c:v libx264 OUT.mp4"
_ANALYSE_US = 2_000_000
"""How long FFmpeg looks at a live stream before it says what is in it: less than any time-out, so
that a stream without a key frame is opened and waited for."""
_FROM_DISK = {"protocol_whitelist": "file,crypto,data"}
"""A playlist on disk does not reach into the network."""
_FROM_NETWORK = {
    "protocol_whitelist": "http,https,httpproxy,tcp,tls,rtp,srtp,udp,rtsp,crypto,data",
    "analyzeduration": str(_ANALYSE_US),
}


def shown_path(path: Path) -> str:
    r"""A path as text that any message can carry: bytes that are not UTF-8 become `\xe9`."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")


def open_file(path: Path) -> InputContainer:
    """Open a video file.

    Raises:
        SourceError: the file is missing, empty, unreadable or no video.
    """
    name = shown_path(path)
    if not path.exists():
        raise SourceError(f"{name}: no such file or folder; check the path")
    if not path.is_file():
        raise SourceError(f"{name}: not a regular file; give a video file or a folder of images")
    if not os.access(path, os.R_OK):
        raise SourceError(f"{name}: may not be read; check its permissions")
    if path.stat().st_size == 0:
        raise SourceError(f"{name}: the file is empty; copy it again")
    try:
        # An absolute path, since FFmpeg takes `a:b.mp4` for a protocol named `a`.
        return av.open(os.path.abspath(path), options=dict(_FROM_DISK))
    except (av.error.FFmpegError, ValueError) as error:
        raise SourceError(
            f"{name}: not a video that FFmpeg can read, or cut off before its index "
            f"({reason(error)}); check the file or convert it"
        ) from None


def open_address(
    address: str, name: str, timeout_s: float, options: Mapping[str, str] | None = None
) -> InputContainer:
    """Open an address; gives up after `timeout_s` seconds without an answer, twice at most.

    Args:
        address: with user and password.
        name: the address for people.
        timeout_s: limit for the connection, for finding out what is in it, and for every read.
        options: of FFmpeg's demuxer and protocol.

    Raises:
        SourceError: nothing answers there, it wants a password, or it is no video.
    """
    try:
        return av.open(
            address, timeout=(timeout_s, timeout_s), options=_FROM_NETWORK | dict(options or {})
        )
    except (av.error.FFmpegError, ValueError) as error:
        raise SourceError(_network_words(error, address, name, timeout_s)) from None


def video_stream(container: InputContainer, name: str) -> VideoStream:
    """The video in a container that is to be shown: the first that is no cover picture.

    Raises:
        SourceError: there is none, or FFmpeg has no decoder for it here.
    """
    streams = container.streams.video
    if not streams:
        raise SourceError(f"{name}: there is sound or text in it, but no video; give a video")
    moving = [one for one in streams if "attached_pic" not in _disposition(one)]
    stream = (moving or list(streams))[0]
    context = stream.codec_context
    if context is None:
        raise SourceError(f"{name}: no decoder here for {_codec(container)}; {CONVERT}")
    # The decoder refuses larger pictures before it takes memory for them.
    context.options = {**context.options, "max_pixels": str(MAX_IMAGE_PIXELS)}
    return stream


def reason(error: Exception) -> str:
    """What FFmpeg says, in one line and without the address."""
    said = getattr(error, "strerror", None) or str(error)
    return " ".join(str(said).split()).lower()


def _network_words(error: Exception, address: str, name: str, timeout_s: float) -> str:
    escapes = f"; {ESCAPES}" if may_hold_unescaped(address) else ""
    if isinstance(error, av.error.HTTPUnauthorizedError | av.error.HTTPForbiddenError):
        return f"{name} refuses user and password, or wants them; check user and password{escapes}"
    if isinstance(error, av.error.HTTPNotFoundError):
        return f"{name}: nothing of that name there (404); check the path of the address{escapes}"
    if isinstance(error, av.error.HTTPError):
        return f"{name} answers with an error ({reason(error)}); look at the camera's own page"
    if isinstance(error, av.error.ConnectionRefusedError):
        return f"{name} refuses the connection; check host and port{escapes}"
    if isinstance(error, av.error.InvalidDataError):
        return (
            f"{name} answers, but not with a video that FFmpeg can read; a web page, perhaps: "
            f"give the address of the stream itself{escapes}"
        )
    if isinstance(error, av.error.ExitError | av.error.TimeoutError):
        return f"{name}: no picture within {timeout_s:g} s; check address, cable and camera"
    return (
        f"nothing that FFmpeg can read answers at {name} ({reason(error)}); check host, port, "
        f"user and password{escapes}"
    )


def _disposition(stream: VideoStream) -> str:
    disposition = stream.disposition
    return disposition.name or "" if disposition else ""


def _codec(container: InputContainer) -> str:
    """The codec of a stream without a decoder, which only FFmpeg's own description tells."""
    described: str = container.dumps_format()  # type: ignore[attr-defined]  # not in the stubs
    found = re.search(r"Video: (\w+)[^,]*", described)
    return "this video" if found is None else f"{found.group(0).removeprefix('Video: ')} video"
