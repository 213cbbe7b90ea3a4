"""Child processes that never outlive the run that started them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from services.runtime.process import PARENT_VARIABLE

_TERM_S = 2.5
_KILL_S = 2.0
_TAIL_BYTES = 65536


@dataclass(frozen=True)
class Child:
    """One started service."""

    name: str
    process: subprocess.Popen[bytes]
    log: Path

    def failure(self) -> str | None:
        """Why it ended badly, in one line; None while it runs or if it ended well."""
        code = self.process.poll()
        if code in (None, 0):
            return None
        return f"{self.name} ended with code {code}: {last_complaint(self.log)}"


class Children:
    """Starts services and ends them: SIGTERM, then SIGKILL, on every way out.

    Each is in a session of its own, so that Ctrl-C reaches only the parent, which then stops them
    in order; the kernel ends them should the parent be killed.
    """

    def __init__(self, log_folder: Path) -> None:
        self._log_folder = log_folder
        self._children: list[Child] = []
        log_folder.mkdir(parents=True, exist_ok=True)

    def __enter__(self) -> Children:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def start(self, service: str, *flags: str) -> Child:
        """Start `python -m services.SERVICE FLAGS`, logging into its own file."""
        log = self._log_folder / f"{service}.log"
        environment = {**os.environ, PARENT_VARIABLE: str(os.getpid())}
        with log.open("wb") as stream:
            process = subprocess.Popen(
                [sys.executable, "-m", f"services.{service}", "--log-format", "json", *flags],
                stdin=subprocess.DEVNULL, stdout=stream, stderr=stream, env=environment,
                start_new_session=True,
            )  # fmt: skip
        child = Child(service, process, log)
        self._children.append(child)
        return child

    def failure(self) -> str | None:
        """Why the first child that ended badly did so; None while all is well."""
        return next(filter(None, (child.failure() for child in self._children)), None)

    def failure_of(self, name: str) -> str | None:
        """Why one child ended badly, None if it did not or was killed for not ending."""
        child = next(child for child in self._children if child.name == name)
        return child.failure() if child.process.returncode == 1 else None

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
        """Ask every child to end, then insist."""
        for child in self._children:
            if child.process.poll() is None:
                child.process.terminate()
        if not self.wait_all(_TERM_S):
            for child in self._children:
                if child.process.poll() is None:
                    child.process.kill()
            self.wait_all(_KILL_S)


def last_complaint(log: Path) -> str:
    """The last error line of a service's log, or its last line."""
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
            last = line.removeprefix("heel: ") or last
            continue
        if isinstance(entry, dict) and entry.get("level") == "error":
            last = str(entry.get("message"))
    return last or f"see {log}"
