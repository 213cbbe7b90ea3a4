"""The command where its standard streams are closed or full, and Ctrl-C while it starts."""

from __future__ import annotations

import shlex
import signal
import subprocess
import sys

import pytest

from tests.support.processes import REPOSITORY, inherited_environment

_DEADLINE_S = 60.0
_IMPORTING = """
import os, runpy, signal, sys

class Interrupted:
    def find_spec(self, name, path=None, target=None):
        if name == "typer":
            os.kill(os.getpid(), signal.SIGINT)

# A parent may have it ignored, as a shell does for what it starts in the background.
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Interrupted())
module = sys.argv[1]
sys.argv = [module, "--help"]
runpy.run_module(module, run_name="__main__", alter_sys=True)
"""
_ENTRIES = sorted((REPOSITORY / "services").glob("*/__main__.py"))
_MODULES = ["heel", *(f"heel.services.{entry.parent.name}" for entry in _ENTRIES)]


def run(command: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, cwd=REPOSITORY, env=inherited_environment(), capture_output=True, text=True,
        timeout=_DEADLINE_S,
    )  # fmt: skip


def shell(redirection: str, *words: str) -> subprocess.CompletedProcess[str]:
    heel = shlex.join([sys.executable, "-m", "heel", *words])
    return run(["sh", "-c", f"exec {heel} {redirection}"])


@pytest.mark.parametrize("redirection", [">&-", "2>&-", "<&-", "<&- >&- 2>&-"])
def test_closed_streams_are_no_error(redirection: str) -> None:
    done = shell(redirection, "--version")
    assert (done.returncode, done.stderr) == (0, "")


def test_a_full_disk_behind_standard_output_is_one_line() -> None:
    done = shell("> /dev/full", "schema", "tracks")
    assert done.returncode == 1
    assert done.stderr == "heel: standard output: No space left on device\n"


@pytest.mark.parametrize("module", _MODULES)
def test_an_interrupt_while_it_starts_just_ends_it(module: str) -> None:
    done = run([sys.executable, "-c", _IMPORTING, module])
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")
