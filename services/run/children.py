"""Child processes of a run, which end with it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Literal

import zenoh

from heel.schemas import HeelError, SettingsError, keys
from heel.services.runtime.process import PARENT_VARIABLE

_TERM_S = 2.5
"""Seconds from SIGTERM to SIGKILL; above `EXIT_DEADLINE_S`, within which a service ends itself."""
_KILL_S = 2.0
"""Longest wait [s] for the end of a killed process; chosen by hand."""
_START_TIMEOUT_S = 60.0
"""Longest start of all services [s], also on a busy machine; chosen by hand."""
_POLL_S = 0.1
"""Seconds between two looks at the processes while they start; chosen by hand."""
_TAIL_BYTES = 65536
"""Bytes at the end of a log that are searched for a complaint: hundreds of lines; chosen by
hand."""
_NO_REASON = (" ", "Traceback", "During handling of", "The above exception")
"""Beginnings of the lines of a traceback that do not state the error."""


@dataclass(frozen=True)
class Child:
    """One started service."""

    name: str
    process: subprocess.Popen[bytes]
    flags: tuple[str, ...] = ()

    @property
    def over(self) -> bool:
        """Whether it has ended, well or badly."""
        return self.process.poll() is not None


def start_python(
    words: Sequence[str], log: IO[bytes], environment: Mapping[str, str]
) -> subprocess.Popen[bytes]:
    """Start Python as a child that ends with this process, see `PARENT_VARIABLE`.

    Args:
        words: arguments after `python -P`.
        log: of its output and errors.
        environment: what it inherits.
    """
    # -P: a `heel.py` in the user's working folder must not be imported.
    return subprocess.Popen(
        [sys.executable, "-P", *words], stdin=subprocess.DEVNULL, stdout=log, stderr=log,
        env={**environment, PARENT_VARIABLE: str(os.getpid())}, start_new_session=True,
    )  # fmt: skip


class Children:
    """Starts services and ends them: SIGTERM, then SIGKILL, on every way out.

    Each is in a session of its own, so that Ctrl-C reaches only the parent, which then stops them
    in order; the kernel ends them should the parent be killed.
    """

    def __init__(self, log_folder: Path | Callable[[], Path]) -> None:
        """Start without children.

        Args:
            log_folder: of the log files, one for each child; or a function that returns it, where
                the folder is moved.
        """
        self._log_folder = log_folder if callable(log_folder) else lambda: log_folder
        self._children: list[Child] = []
        self._log_folder().mkdir(parents=True, exist_ok=True)

    def __enter__(self) -> Children:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def start(self, service: str, *flags: str) -> Child:
        """Start `python -m heel.services.SERVICE FLAGS`, logging into its own file."""
        child = self._started(service, flags, "wb")
        self._children.append(child)
        return child

    def start_again(self, service: str) -> None:
        """Start a service as before, in place of its process, which is killed if it still runs."""
        place = next(k for k, child in enumerate(self._children) if child.name == service)
        before = self._children[place]
        if not before.over:
            before.process.kill()
            with suppress(subprocess.TimeoutExpired):  # only a device can hold it; it ends with it
                before.process.wait(_KILL_S)
        self._children[place] = self._started(service, before.flags, "ab")

    def _started(self, service: str, flags: tuple[str, ...], mode: Literal["wb", "ab"]) -> Child:
        words = ("-m", f"heel.services.{service}", "--log-format", "json", *flags)
        with self._log(service).open(mode) as log:
            return Child(service, start_python(words, log, os.environ), flags)

    @property
    def logs(self) -> Path:
        """Where the log files are now."""
        return self._log_folder()

    def pids(self) -> dict[str, int]:
        """The processes that have been started, by name."""
        return {child.name: child.process.pid for child in self._children}

    def failure(self) -> HeelError | None:
        """Error of the first child that failed; None while none has.

        It is a `SettingsError` where the child ended with a `SettingsError`.
        """
        return next(filter(None, map(self._failure, self._children)), None)

    def ended(self, *but: str) -> str | None:
        """The first child that has ended, well or badly, and is not among those named."""
        return next((one.name for one in self._children if one.over and one.name not in but), None)

    def exit_code(self, name: str) -> int | None:
        """Of a child that has ended; None while it lives, or is not started yet."""
        found = (child.process.poll() for child in self._children if child.name == name)
        return next(found, None)

    def is_running(self, name: str) -> bool:
        """Whether a child is neither over nor stopped by a signal (SIGSTOP)."""
        return any(
            not child.over and _state(child.process.pid) != "T"
            for child in self._children if child.name == name
        )  # fmt: skip

    def over(self, name: str) -> bool:
        """Whether the child of that name, if there is one, has ended."""
        return any(child.over for child in self._children if child.name == name)

    def failure_of(self, name: str) -> HeelError | None:
        """Error of one child, None if it did not fail or was killed because it did not end."""
        child = next(child for child in self._children if child.name == name)
        return self._failure(child) if child.process.returncode in (1, 2) else None

    def last_words(self, name: str) -> str:
        """The last error in a child's log as the end of a sentence; empty if it has none."""
        complaint = last_complaint(self._log(name))
        return f"; its last words: {complaint}" if complaint else ""

    def _log(self, service: str) -> Path:
        return self._log_folder() / f"{service}.log"

    def _failure(self, child: Child) -> HeelError | None:
        code = child.process.poll()
        if code in (None, 0):
            return None
        kind = SettingsError if code == 2 else HeelError
        log = self._log(child.name)
        complaint = last_complaint(log) or f"it says nothing in {log}"
        return kind(f"{child.name} ended with code {code}: {complaint}")

    def wait_all(self, timeout_s: float) -> bool:
        """Wait for every child to end by itself; False if some have not."""
        deadline_s = time.monotonic() + timeout_s
        for child in self._children:
            try:
                child.process.wait(max(0.01, deadline_s - time.monotonic()))
            except subprocess.TimeoutExpired:
                return False
        return True

    def end(self) -> None:
        """Terminate every child, then kill those that have not ended."""
        for child in self._children:
            if child.process.poll() is None:
                child.process.terminate()
        if not self.wait_all(_TERM_S):
            for child in self._children:
                if child.process.poll() is None:
                    child.process.kill()
            self.wait_all(_KILL_S)


def await_present(
    session: zenoh.Session, children: Children, wanted: set[str], stop: threading.Event
) -> None:
    """Wait until every service has subscribed: a frame sent earlier would be lost.

    Raises:
        HeelError: one of them ended, or is not up in time.
    """
    present: set[str] = set()
    changed = threading.Event()

    def seen(sample: zenoh.Sample) -> None:
        present.add(str(sample.key_expr).split("/")[1])
        changed.set()

    watch = session.liveliness().declare_subscriber(keys.ALL_ALIVE, seen, history=True)
    deadline_s = time.monotonic() + _START_TIMEOUT_S
    while not present >= wanted and not stop.is_set():
        changed.wait(_POLL_S)
        changed.clear()
        if (failure := children.failure()) is not None:
            raise failure
        if time.monotonic() > deadline_s:
            missing = ", ".join(sorted(wanted - present))
            raise HeelError(
                f"{missing} not up within {_START_TIMEOUT_S:g} s: is the machine very busy?"
            )
    watch.undeclare()  # type: ignore[no-untyped-call]


def _state(pid: int) -> str:
    """A process's state as the kernel says it (proc(5)); empty if there is none."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (OSError, IndexError):
        return ""


def last_complaint(log: Path) -> str:
    """The last error line of a service's log, or of what is no log line; empty if there is none."""
    try:
        with log.open("rb") as stream:
            stream.seek(max(0, log.stat().st_size - _TAIL_BYTES))
            lines = stream.read().decode("utf-8", "replace").splitlines()
    except OSError as error:
        return f"its log {log} cannot be read ({error.strerror})"
    last = ""
    for line in lines:
        try:
            entry = json.loads(line)
        except ValueError:
            if not line.startswith(_NO_REASON):
                last = line.removeprefix("heel: ") or last
            continue
        if isinstance(entry, dict) and entry.get("level") in ("error", "critical"):
            last = str(entry.get("message"))
    return last
