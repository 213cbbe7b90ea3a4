"""Packets of a recording at the end of a network, read ahead by a thread of their own."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import TYPE_CHECKING

import av.error

from heel.schemas.errors import SourceError
from heel.services.capture.source import SourceTimeout

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.packet import Packet
    from av.video.stream import VideoStream

_MOST_PACKETS = 64
"""Packets that wait to be decoded: two seconds of a camera."""
_MOST_BYTES = 16 << 20
"""Of those packets together; chosen by hand."""
_FIRST_TIMEOUT_S = 10.0
"""Seconds that a camera has for its first packet; chosen by hand."""


class ReadAhead:
    """Iterates over the packets; every step keeps its deadline whatever the network does.

    The thread waits when it is far enough ahead. It ends with the container's read time-out at the
    latest after `close`, and closes the container.

    Args:
        container: belongs to this object from now on; opened with a read time-out.
        stream: of it.
        stop: ends a step at once.

    Attributes:
        timeout_s: of a step.
    """

    def __init__(
        self, container: InputContainer, stream: VideoStream, stop: threading.Event | None = None
    ) -> None:
        self.timeout_s = _FIRST_TIMEOUT_S
        self._stop = stop or threading.Event()
        self._changed = threading.Condition()
        # Everything below is guarded by the condition.
        self._packets: deque[Packet[VideoStream]] = deque()
        self._bytes = 0
        self._done = self._closing = False
        self._error: Exception | None = None
        threading.Thread(
            target=self._read, args=(container, stream), name="recording-reader", daemon=True
        ).start()

    def __iter__(self) -> ReadAhead:
        return self

    def __next__(self) -> Packet[VideoStream]:
        """The next packet.

        Raises:
            SourceTimeout: none came within `timeout_s`; the next step may succeed.
            SourceError: told to stop.
            av.error.FFmpegError: the connection broke.
        """
        deadline_s = time.monotonic() + self.timeout_s
        with self._changed:
            while not self._packets and not self._done and not self._closing:
                if self._stop.is_set():
                    raise SourceError("no frame yet, when told to end")
                if time.monotonic() > deadline_s:
                    raise SourceTimeout(f"the server sent nothing for {self.timeout_s:g} s")
                self._changed.wait(0.05)
            if self._packets and not self._closing:
                packet = self._packets.popleft()
                self._bytes -= packet.size
                self._changed.notify_all()
                return packet
            error, self._error = self._error, None
        if error is not None:
            raise error
        raise StopIteration

    def close(self) -> None:
        """Let the thread end, soon."""
        with self._changed:
            self._closing = True
            self._packets.clear()
            self._changed.notify_all()

    def _read(self, container: InputContainer, stream: VideoStream) -> None:
        error: Exception | None = None
        try:
            with container:
                for packet in container.demux(stream):
                    if packet.size and not self._put(packet):
                        break
        except (av.error.FFmpegError, ValueError) as problem:
            error = problem
        finally:
            with self._changed:
                self._error, self._done = error, True
                self._changed.notify_all()

    def _put(self, packet: Packet[VideoStream]) -> bool:
        with self._changed:
            self._changed.wait_for(
                lambda: (
                    self._closing
                    or (len(self._packets) < _MOST_PACKETS and self._bytes < _MOST_BYTES)
                )
            )
            self._packets.append(packet)
            self._bytes += packet.size
            self._changed.notify_all()
            return not self._closing
