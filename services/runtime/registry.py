"""Which runs of this user are going on at this machine, so that commands find them.

`heel demo` and `heel run` take a router port of their own; each leaves a note in the private run
folder for as long as it lives.
"""

from __future__ import annotations

import json
import logging
import os
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from heel.schemas.errors import HeelError
from heel.services.runtime.logs import printable
from heel.services.runtime.places import run_folder

_FOLDER = "runs"
_MAX_RUNS = 64
"""Runs that are listed; chosen by hand."""
_MAX_BYTES = 8192
"""Of a note; ours have some hundred bytes."""
_LONGEST_PATH = 4096
"""Characters of a path; Linux takes no more."""
_LOOK_S = 1.0
"""Seconds between two looks whether the note is still there; chosen by hand."""


class Run(BaseModel):
    """One run that is going on."""

    model_config = ConfigDict(frozen=True)

    pid: Annotated[int, Field(gt=0)]
    started: str = Field(description="when the process began, as the kernel tells it")
    kind: str = Field(description="the command: demo, run")
    what: str = Field("", description="what it plays, for people")
    endpoint: str = Field(description="of its router")
    robot: str = Field("", description="name that a user gave it")
    parts: tuple[str, ...] = Field((), description="services that it has started")
    pids: dict[str, int] = Field(default_factory=dict, description="their processes, by name")
    page: str | None = Field(None, description="address of its live page")
    logs: str | None = Field(None, description="folder of the services' logs")

    def shown(self) -> str:
        """One line for a user that has to choose."""
        page = f", page {self.page}" if self.page else ""
        named = f"--robot {self.robot}" if self.robot else f"--run {self.pid}"
        return f"{named} (heel {self.kind} {self.what}".rstrip() + f"{page})"


class Registration:
    """The note of one run; changed as the run learns more."""

    def __init__(self, run: Run, file: Path | None) -> None:
        self._run, self._file = run, file
        self._writing = threading.Lock()

    def page_is(self, url: str) -> None:
        """The live page is served now."""
        self._tell(page=url)

    def processes_are(self, pids: Mapping[str, int], logs: Path) -> None:
        """The services have been started."""
        self._tell(pids=dict(pids), logs=printable(str(logs.absolute()), _LONGEST_PATH))

    def _tell(self, **news: object) -> None:
        self._run = self._run.model_copy(update=news)
        with suppress(OSError):
            self._write()

    def _write(self) -> None:
        if self._file is None:
            return
        # Renamed into place, so that no reader gets half a note.
        with self._writing:
            whole = self._file.with_suffix(".new")
            whole.write_text(self._run.model_dump_json(), encoding="utf-8")
            whole.replace(self._file)

    def _look_after(self, over: threading.Event) -> None:
        """Write the note anew where its folder has gone: with a session, or by a clean-up."""
        while not over.wait(_LOOK_S):
            with suppress(OSError, HeelError):
                file = _note(self._run.pid)
                if file == self._file and file.exists():
                    continue
                gone, self._file = self._file, file
                self._write()
                if gone is not None and gone != file:
                    gone.unlink(missing_ok=True)

    def _remove(self) -> None:
        with suppress(OSError):
            if self._file is not None:
                self._file.unlink(missing_ok=True)


def _note(pid: int) -> Path:
    """Where a run's note is; its folder is made.

    Raises:
        SettingsError: the run folder cannot be used.
    """
    folder = run_folder() / _FOLDER
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder / f"{pid}.json"


@contextmanager
def registered(
    kind: str,
    what: str,
    endpoint: str,
    parts: tuple[str, ...],
    log: logging.Logger,
    robot: str = "",
) -> Iterator[Registration]:
    """Be found by `heel status`, `follow`, `stop` and `resume` while the block runs.

    A run folder that cannot be used is a warning: the run itself does not need it.
    """
    pid = os.getpid()
    run = Run(pid=pid, started=_started(pid) or "", kind=kind, what=printable(what),
              endpoint=endpoint, parts=parts, robot=robot)  # fmt: skip
    registration = Registration(run, None)
    try:
        registration = Registration(run, _note(pid))
        registration._write()
    except (HeelError, OSError) as error:
        log.warning("`heel status` and `heel stop` need --connect %s: %s", endpoint, error)
    over = threading.Event()
    looking = threading.Thread(
        target=registration._look_after, args=(over,), name="run-note", daemon=True
    )
    looking.start()
    try:
        yield registration
    finally:
        over.set()
        looking.join(_LOOK_S)
        registration._remove()


def runs() -> list[Run]:
    """Every run that goes on, the oldest note first; notes of others are removed.

    Raises:
        SettingsError: the run folder cannot be used.
    """
    notes = sorted((run_folder() / _FOLDER).glob("*.json"), key=_modified_s)
    found: list[Run] = []
    for note in notes:
        run = _read(note)
        if run is None or is_over(run):
            with suppress(OSError):
                note.unlink(missing_ok=True)
        elif len(found) < _MAX_RUNS:
            found.append(run)
    return found


def is_over(run: Run) -> bool:
    """Whether its process has ended; another one may have its number by now."""
    return _started(run.pid) != run.started


def _read(note: Path) -> Run | None:
    try:
        with note.open("rb") as stream:
            return Run.model_validate(json.loads(stream.read(_MAX_BYTES)))
    except (OSError, ValueError, ValidationError, RecursionError):
        return None


def _modified_s(note: Path) -> float:
    try:
        return note.stat().st_mtime
    except OSError:
        return 0.0


def _started(pid: int) -> str | None:
    """What tells a process from a later one of the same number; None if it does not live."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    state, ticks = words[0], words[19]
    return None if state in "ZX" else f"{boot} {ticks}"
