"""The health message's word in a file, for the health check of a container.

Reading a file costs a check 10 ms of processor time; asking over Zenoh as `heel status` does
costs 600 ms (measured), and one check per container comes round every few seconds.
"""

from __future__ import annotations

from pathlib import Path


class HealthFile:
    """One line, `STATE REASON`, renewed with every health message: an old file is a bad sign."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._failure: str | None = None

    def write(self, state: str, reason: str) -> str | None:
        """Replace the line; returns a complaint if that fails and did not fail before."""
        # Renamed into place, so that a check never reads half a line.
        whole = self._path.with_name(f"{self._path.name}.new")
        failure = None
        try:
            whole.write_text(f"{state} {reason}\n", encoding="utf-8")
            whole.replace(self._path)
        except OSError as error:
            failure = f"health file {self._path}: {error.strerror}: name another --health-file"
        news, self._failure = failure != self._failure, failure
        return failure if news else None
