"""The newest state of a process in the run folder, for the one that is started after it."""

from __future__ import annotations

import logging
import os
import threading
import time
from contextlib import ExitStack, suppress
from pathlib import Path

from heel.schemas import HeelError, Message, Snapshot, decode, encode
from heel.services.runtime import places

_KEPT_S = 10.0
"""A process that comes later than this begins anew: everybody may be elsewhere by then. Chosen by
hand; starting takes 1 to 3 s."""
_WRITTEN_S = 1.0
"""Seconds between two states that are written; chosen by hand: each takes a millisecond or two of
the time between two frames."""
_END_S = 0.5
"""Longest wait [s] for the writing at the end; chosen by hand."""


class StateFile:
    """Written by a thread of its own, so that no frame waits for a disk.

    It holds how people look, so that only its owner may read it.

    Args:
        name: of the file in the run folder.
        resources: end the thread.
        log: of the service.
    """

    def __init__(self, name: str, resources: ExitStack, log: logging.Logger) -> None:
        self._log = log
        self._file = _place(name)
        self._newest: Message | None = None
        self._due_s = 0.0
        self._ready = threading.Condition()
        self._ended = False
        if self._file is not None:
            thread = threading.Thread(target=self._write_all, name="state", daemon=True)
            thread.start()
            resources.callback(self._end, thread)

    def is_due(self, now_s: float) -> bool:
        """Whether a state should be written at this time."""
        return self._file is not None and now_s >= self._due_s

    def write(self, state: Message, now_s: float) -> None:
        """Have a state written soon; one that still waits gives way to it."""
        self._due_s = now_s + _WRITTEN_S
        with self._ready:
            self._newest = state
            self._ready.notify()

    def load(self) -> Snapshot | None:
        """What a process before has left, if it ended a moment ago."""
        if self._file is None:
            return None
        try:
            age_s = time.time() - self._file.stat().st_mtime
            if not -_WRITTEN_S <= age_s <= _KEPT_S:
                # Appearances of people are not kept for longer than they are of use.
                self._file.unlink()
                return None
            with self._file.open("rb") as stream:
                return decode(Snapshot, stream.read(Snapshot.max_bytes + 1))
        except FileNotFoundError:
            return None
        except (OSError, HeelError) as error:
            self._log.warning("%s cannot be used (%s): beginning anew", self._file, error)
            return None

    def _write_all(self) -> None:
        while True:
            with self._ready:
                while self._newest is None and not self._ended:
                    self._ready.wait()
                state, self._newest = self._newest, None
            if state is None:
                return
            try:
                self._write(encode(state))
            except (OSError, HeelError) as error:
                self._log.warning("the state cannot be written to %s (%s): after a crash this "
                                  "process begins anew", self._file, error)  # fmt: skip
                return

    def _write(self, data: bytes) -> None:
        assert self._file is not None
        beside = self._file.with_suffix(".new")
        with suppress(FileNotFoundError):
            beside.unlink()
        descriptor = os.open(
            beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600
        )
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(data)
        beside.replace(self._file)

    def _end(self, thread: threading.Thread) -> None:
        with self._ready:
            self._ended = True
            self._ready.notify()
        thread.join(_END_S)


def _place(name: str) -> Path | None:
    try:
        run = places.private_run()
        return places.run_folder() / f"{name}{run and f'-{run}'}"
    except HeelError:
        # The emergency stop warns of a run folder that cannot be used.
        return None
