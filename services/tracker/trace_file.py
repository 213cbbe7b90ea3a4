"""A trace as a file: one JSON object a line, the first one says what the file is."""

from __future__ import annotations

import json
import logging
import os
from dataclasses import fields
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from heel.schemas.errors import HeelError, SettingsError
from heel.services.runtime.row_file import RowFile
from heel.services.tracker.trace import Event

VERSION = 1
"""Of the lines of a trace, without a unit: another number is another format."""
_HEADER = "heel_trace"
MOST_BYTES = 64 * 1024 * 1024
"""Bytes after which a trace ends and says so: some 500,000 events, days of a street; chosen by
hand."""
_DIGITS = 6
"""Significant digits of a number in the file: finer than any that is told; chosen by hand."""
_NO_NUMBER = {field.name: field.default for field in fields(Event)}
_EVENT = TypeAdapter(Event)
_log = logging.getLogger(__name__)


def check_place(path: Path) -> None:
    """Whether a trace can be written there, without making the file.

    Raises:
        SettingsError: it is no place for a file.
    """
    # A pipe without a reader would hold the tracker up for good.
    wrong = path.is_dir() or path.is_symlink() or path.is_fifo()
    if wrong or not os.access(path.parent, os.W_OK):
        raise SettingsError(f"--trace {path}: give a file, in a folder that can be written to")


class TraceFile:
    """Writes events as they come; each is whole on the disk, whatever becomes of the process.

    A full disk ends the trace with a warning, and never the tracker.

    Usage:
        with TraceFile(path) as file:
            trace.add(file.take)
    """

    def __init__(self, path: Path, most_bytes: int = MOST_BYTES) -> None:
        """Make the file, or empty the one that is there.

        Raises:
            SettingsError: it cannot be written.
        """
        self._path, self._most_bytes = path, most_bytes
        check_place(path)
        try:
            self._file = RowFile(path)
        except OSError as error:
            raise SettingsError(f"--trace {path}: {error.strerror}: give another file") from None
        self._open = True
        self._append({_HEADER: VERSION})

    def __enter__(self) -> TraceFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()
        self._open = False

    def take(self, event: Event) -> None:
        """Write one event; after the last one that there is room for nothing more."""
        if not self._open:
            return
        if self._file.size >= self._most_bytes:
            _log.warning("%s has %d bytes: the trace ends here", self._path, self._file.size)
            self._append(_as_json(Event("full", frame=event.frame, t_s=event.t_s)))
            self._open = False
            return
        self._append(_as_json(event))

    def _append(self, line: dict[str, object]) -> None:
        try:
            self._file.append(json.dumps(line, separators=(",", ":")) + "\n")
        except OSError as error:
            _log.warning("%s: %s: the trace ends here", self._path, error.strerror)
            self._open = False


def read_trace(path: Path) -> list[Event]:
    """The events of a trace, in the order in which they were written.

    Raises:
        HeelError: the file cannot be read, is none of these, or is damaged.
    """
    if path.exists() and not path.is_file():
        raise HeelError(f"{path}: not a file: give a file made with --trace")
    try:
        with path.open("rb") as file:
            content = file.read(2 * MOST_BYTES + 1)
    except OSError as error:
        raise HeelError(f"{path}: {error.strerror}: give a file made with --trace") from None
    if len(content) > 2 * MOST_BYTES:
        raise HeelError(f"{path}: larger than any trace: give a file made with --trace")
    lines = content.split(b"\n")
    head = _object(lines[0])
    if head is None or head.keys() != {_HEADER}:
        raise HeelError(f"{path}: no trace of Heel: give a file made with --trace")
    if head[_HEADER] != VERSION:
        raise HeelError(
            f"{path}: its version is not {VERSION}, which this Heel reads: use the Heel that made "
            "it, or make it anew"
        )
    events = []
    for number, line in enumerate(lines[1:], start=2):
        if not line:
            continue
        try:
            events.append(_EVENT.validate_json(line))
        except ValidationError:
            raise HeelError(
                f"{path}: line {number} is damaged: delete the line, or make the trace anew"
            ) from None
    return events


def _as_json(event: Event) -> dict[str, object]:
    line: dict[str, object] = {"frame": event.frame, "t_s": round(event.t_s, _DIGITS)}
    for name, default in _NO_NUMBER.items():
        value = getattr(event, name)
        if name not in line and value != default:
            line[name] = float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value
    return line


def _object(line: bytes) -> dict[str, object] | None:
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None
