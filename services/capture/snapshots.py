"""A camera that gives one picture a request: `http://camera/snapshot.jpg`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import av.error

from heel.schemas.errors import SourceError
from heel.services.capture.decoding import Converter, Decoder
from heel.services.capture.device import Picture
from heel.services.capture.ffmpeg import reason, video_stream

if TYPE_CHECKING:
    from av.container import InputContainer

_USUAL_FPS = 5.0
"""Requests per second where no rate is given; more is a burden on most cameras."""


class SnapshotDevice:
    """Fetches a picture per period.

    Args:
        connect: opens the address.
        name: for people.
        fps: pictures per second.
    """

    def __init__(
        self, connect: Callable[[], InputContainer], name: str, fps: float | None = None
    ) -> None:
        self._connect, self._name = connect, name
        self.fps = fps or _USUAL_FPS
        self.complaint = ""
        self._due_s = 0.0
        self._closing = threading.Event()

    def read(self) -> Picture:
        """Fetch the next picture when it is due; see `Device`."""
        self._closing.wait(max(0.0, self._due_s - time.monotonic()))
        if self._closing.is_set():
            raise SourceError("closed")
        # The picture may be as old as the request for it.
        asked_ns = time.monotonic_ns()
        self._due_s = max(self._due_s + 1.0 / self.fps, asked_ns * 1e-9)
        try:
            with self._connect() as container:
                stream = video_stream(container, self._name)
                decoder = Decoder(stream)
                for packet in container.demux(stream):
                    for decoded in decoder.decode(packet if packet.size else None):
                        if not decoded.damaged:
                            return Picture(Converter().image(decoded.frame), asked_ns)
        except av.error.FFmpegError as error:
            raise SourceError(f"the connection broke ({reason(error)})") from None
        raise SourceError("the picture cannot be decoded")

    def interrupt(self) -> None:
        """Ask for no more."""
        self._closing.set()

    def close(self) -> None:
        """Between two pictures there is nothing to close."""
