"""What a process leaves in shared memory: nothing that it is the last to hold."""

from __future__ import annotations

import fcntl
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from heel.services.runtime.shared_memory import remove_own_segments

HOLDER = """
import fcntl, sys
segment = open(sys.argv[1], "rb")
fcntl.flock(segment, fcntl.LOCK_SH)
print("held", flush=True)
sys.stdin.read()
"""


@contextmanager
def held_here(segment: Path) -> Iterator[None]:
    """As Zenoh holds what it maps: a shared lock on the open file."""
    with segment.open("rb") as stream:
        fcntl.flock(stream, fcntl.LOCK_SH)
        yield


@contextmanager
def held_elsewhere(segment: Path) -> Iterator[None]:
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(segment)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as holder:
        assert holder.stdin is not None
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        try:
            yield
        finally:
            holder.stdin.close()


@pytest.fixture
def segment(tmp_path: Path) -> Path:
    file = tmp_path / "123.zenoh"
    file.write_bytes(b"pixels")
    return file


def test_a_segment_that_only_we_hold_goes(segment: Path) -> None:
    with held_here(segment):
        remove_own_segments(segment.parent)
    assert not segment.exists()


def test_a_segment_that_another_process_holds_stays_until_that_one_ends(segment: Path) -> None:
    with held_here(segment), held_elsewhere(segment):
        remove_own_segments(segment.parent)
        assert segment.exists()
    with held_here(segment):
        remove_own_segments(segment.parent)
    assert not segment.exists()


def test_segments_that_we_do_not_hold_and_other_files_stay(segment: Path, tmp_path: Path) -> None:
    other = tmp_path / "notes.txt"
    other.write_bytes(b"")
    with held_here(other):
        remove_own_segments(tmp_path)
    assert segment.exists()
    assert other.exists()


def test_a_segment_that_is_gone_already_is_no_error(segment: Path) -> None:
    with held_here(segment):
        segment.unlink()
        remove_own_segments(segment.parent)
