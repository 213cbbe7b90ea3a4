"""What the router's Zenoh says on its own output, told in Heel's words where it matters.

Zenoh has no callback for refused clients or for a thread of its own that panicked: it writes lines.
"""

from __future__ import annotations

import logging
import os
import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import IO

from heel.services.runtime.logs import OncePerSecond, printable

ZENOH_FILTER = (
    "error,zenoh_transport::unicast::establishment::accept=debug,zenoh_link_tcp::unicast=debug"
)
_MOST_LINE_CHARACTERS = 500
"""Of a line of Zenoh's that is read; chosen by hand."""
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_CONNECTED = re.compile(r"Accepted TCP connection on \S+: (\S+)")
_REFUSED = re.compile(r"UsrPwd extension - Recv \w+\. ([^.]+)\.")
_LEVEL = re.compile(r"^\S+Z +(ERROR|WARN|INFO|DEBUG|TRACE) ")
_REASONS = {"Invalid user": "no such user", "Invalid password": "wrong password",
            "Expected extension": "no user named"}  # fmt: skip


class RouterLog:
    """Reads the lines of Zenoh; logs refused clients, and calls `on_panic` when a thread died."""

    def __init__(self, log: logging.Logger, on_panic: Callable[[], None]) -> None:
        self._log = log
        self._warn = OncePerSecond(log)
        self._on_panic = on_panic
        self._from = "an unknown address"
        self._all = "RUST_LOG" in os.environ

    def line(self, text: str, now_s: float) -> None:
        """Take one line, at a monotonic time."""
        text = printable(_COLOURS.sub("", text).strip())[:_MOST_LINE_CHARACTERS]
        if connected := _CONNECTED.search(text):
            self._from = connected[1]
        elif refused := _REFUSED.search(text):
            reason = _REASONS.get(refused[1], refused[1])
            self._warn.warning("refused", f"refused a client at {self._from}: {reason}", now_s)
        elif "panicked at" in text:
            self._log.error("a thread of Zenoh has died: %s", text)
            self._on_panic()
        elif not (level := _LEVEL.search(text)):
            self._warn.warning("output", text, now_s)
        elif level[1] == "ERROR":
            self._warn.warning("zenoh", text, now_s)
        elif self._all:
            self._log.info("%s", text)


@contextmanager
def reading_output(log: RouterLog) -> Iterator[None]:
    """Within, what is written to descriptors 1 and 2 goes to `log` instead.

    Set logging up before on a copy of descriptor 2 (`standard_error`): what Python logs must not
    come back as a line to read.
    """
    kept = os.dup(1), os.dup(2)
    reading, writing = os.pipe()
    for descriptor in (1, 2):
        os.dup2(writing, descriptor)
    os.close(writing)
    reader = threading.Thread(target=_read, args=(reading, log), name="zenoh-log", daemon=True)
    reader.start()
    try:
        yield
    finally:
        for descriptor, copy in zip((1, 2), kept, strict=True):
            os.dup2(copy, descriptor)
            os.close(copy)
        reader.join(timeout=1.0)


def standard_error() -> IO[str]:
    """A stream on a copy of descriptor 2, to log on while the descriptor is read."""
    return os.fdopen(os.dup(2), "w", encoding="utf-8", errors="replace")


def _read(descriptor: int, log: RouterLog) -> None:
    with os.fdopen(descriptor, "r", encoding="utf-8", errors="replace") as lines:
        for text in lines:
            log.line(text, time.monotonic())
