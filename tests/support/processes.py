"""Processes of the system under test: every wait has a deadline and nothing outlives its test."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from heel.services.models.store import VARIABLE as MODELS

REPOSITORY = Path(__file__).resolve().parents[2]


class Running:
    """A started process and what it has written so far."""

    def __init__(self, process: subprocess.Popen[bytes], out: IO[bytes], err: IO[bytes]) -> None:
        self.process = process
        self._out, self._err = out, err

    @property
    def alive(self) -> bool:
        """Whether it still runs."""
        return self.process.poll() is None

    def stdout(self) -> str:
        """Standard output up to now."""
        return _content(self._out)

    def stderr(self) -> str:
        """Standard error up to now."""
        return _content(self._err)

    def wait(self, deadline_s: float) -> int:
        """Exit code.

        Raises:
            AssertionError: the process still runs after `deadline_s`.
        """
        try:
            return self.process.wait(deadline_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(
                f"{self.process.args!r} still runs after {deadline_s:g} s:\n{self.stderr()}"
            ) from None

    def stop(self, number: signal.Signals, deadline_s: float) -> tuple[int, float]:
        """Send a signal; exit code and seconds it took."""
        started_s = time.monotonic()
        self.process.send_signal(number)
        code = self.wait(deadline_s)
        return code, time.monotonic() - started_s


def _content(file: IO[bytes]) -> str:
    return os.pread(file.fileno(), 1 << 20, 0).decode(errors="replace")


def inherited_environment() -> dict[str, str]:
    """Without Heel's variables but the one that keeps a developer's networks out."""
    return {
        key: value for key, value in os.environ.items()
        if not key.startswith("HEEL_") or key == MODELS
    }  # fmt: skip


@contextmanager
def running(*arguments: str, **environment: str) -> Iterator[Running]:
    """Run Python with `arguments` in the repository; killed with its children on the way out.

    The environment is `inherited_environment`.
    """
    inherited = inherited_environment()
    path = os.pathsep.join(filter(None, [str(REPOSITORY), inherited.get("PYTHONPATH")]))
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = subprocess.Popen(
            [sys.executable, *arguments],
            cwd=REPOSITORY, env=inherited | {"PYTHONPATH": path} | environment,
            stdin=subprocess.DEVNULL, stdout=out, stderr=err, start_new_session=True,
        )  # fmt: skip
        try:
            yield Running(process, out, err)
        finally:
            # The group outlives its leader if children were left: both are ended here.
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def finished(*arguments: str, deadline_s: float = 20.0, **environment: str) -> tuple[int, str, str]:
    """Run to the end: exit code, standard output, standard error."""
    with running(*arguments, **environment) as process:
        code = process.wait(deadline_s)
        return code, process.stdout(), process.stderr()
