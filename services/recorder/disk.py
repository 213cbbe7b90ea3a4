"""The thread that writes: a disk that stalls holds up neither the service's loop nor the bus."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path

from heel.services.recorder.files import RecordingFiles
from heel.services.recordings.wire import FLUSH_PERIOD_S, WireMessage

_LONGEST_CLOSE_S = 1.2
"""Seconds that the end of a recording may take: a service is ended by force half a second later."""


@dataclass
class Saving:
    """The last seconds on their way to a file of their own.

    Attributes:
        reason: a word for the file's name.
        messages: what is written.
        done: set when it is over.
        path: of the file, None if it could not be written.
    """

    reason: str
    messages: list[WireMessage]
    done: threading.Event = field(default_factory=threading.Event)
    path: Path | None = None


class DiskThread(threading.Thread):
    """Writes what it is given, in order.

    Args:
        files: used by this thread alone from its start on.
        queue_bytes: bound of what waits for the disk.
    """

    def __init__(self, files: RecordingFiles, queue_bytes: int, log: logging.Logger) -> None:
        super().__init__(name="disk", daemon=True)
        self._files, self._queue_bytes, self._log = files, queue_bytes, log
        self._changed = threading.Condition()
        self._queue: deque[WireMessage] = deque()
        self._bytes = 0
        self._saving: Saving | None = None
        self._closing = False
        self.too_slow = 0
        """Messages that were lost because the disk was behind."""
        self.failure: str | None = None
        """What went wrong in this thread, if anything did."""

    def put(self, message: WireMessage) -> bool:
        """Take a message; False if too much waits already."""
        with self._changed:
            if self._bytes + message.size > self._queue_bytes:
                self.too_slow += 1
                return False
            self._queue.append(message)
            self._bytes += message.size
            self._changed.notify()
            return True

    def save(self, saving: Saving) -> bool:
        """Take a file's worth of messages; False while the one before is not written."""
        with self._changed:
            if self._saving is not None:
                return False
            self._saving = saving
            self._changed.notify()
            return True

    def close(self) -> None:
        """Write what waits and end, within a bounded time."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        self.join(_LONGEST_CLOSE_S)

    def run(self) -> None:
        """Write until `close`."""
        while not self._turn():
            pass
        self._files.close(time.monotonic())

    def _turn(self) -> bool:
        """One round; True at the end."""
        with self._changed:
            self._changed.wait_for(
                lambda: self._queue or self._saving or self._closing, FLUSH_PERIOD_S / 2
            )
            message = self._queue.popleft() if self._queue else None
            saving = self._saving if message is None else None
            over = self._closing and message is None and saving is None
        try:
            now_s = time.monotonic()
            if message is not None:
                self._files.add(message, now_s)
            if saving is not None:
                self._write(saving, now_s)
            self._files.tick(now_s)
        # Nothing that one message or one look does may end all recording.
        except Exception as error:
            self._files.abandon()
            self._report(error)
        finally:
            with self._changed:
                self._bytes -= 0 if message is None else message.size
        return over

    def _write(self, saving: Saving, now_s: float) -> None:
        try:
            saving.path = self._files.write_whole(saving.reason, saving.messages, now_s)
        finally:
            saving.messages = []
            with self._changed:
                self._saving = None
            saving.done.set()

    def _report(self, error: Exception) -> None:
        words = " ".join(str(error).split())[:160]
        reason = f"recording failed: {type(error).__name__}: {words}: please report it"
        if reason != self.failure:
            self._log.error("%s", reason, exc_info=True)
        self.failure = reason
