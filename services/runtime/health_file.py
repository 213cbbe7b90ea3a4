"""The health message's word in a file, for the health check of a container.

Reading a file costs a check 10 ms of processor time; asking over Zenoh as `heel status` does
costs 600 ms (measured), and one check per container comes round every few seconds.
"""

from __future__ import annotations

import time
from pathlib import Path

_PERIOD_S = 0.9
"""Seconds: at least once a second is promised."""


class HealthFile:
    """One line, `STATE REASON`, renewed at least once a second: an old file is a bad sign."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._failure: str | None = None
        self._written: tuple[str, str] | None = None
        self._due_s = 0.0

    def renew(self, state: str, reason: str) -> str | None:
        """Write what is new at once, and what is not once a second; a complaint as by `write`."""
        now_s = time.monotonic()
        if (state, reason) == self._written and now_s < self._due_s:
            return None
        self._written, self._due_s = (state, reason), now_s + _PERIOD_S
        return self.write(state, reason)

    def write(self, state: str, reason: str) -> str | None:
        """Replace the line; returns a complaint if that fails and did not fail before."""
        # Renamed into place, so that a check never reads half a line.
        whole = self._path.with_name(f"{self._path.name}.new")
        failure = None
        try:
            whole.unlink(missing_ok=True)
            # Made anew: a link of that name would lead to another user's file.
            with whole.open("x", encoding="utf-8") as file:
                file.write(f"{state} {reason}\n")
            whole.replace(self._path)
        except OSError as error:
            failure = f"health file {self._path}: {error.strerror}: name another --health-file"
        news, self._failure = failure != self._failure, failure
        return failure if news else None
