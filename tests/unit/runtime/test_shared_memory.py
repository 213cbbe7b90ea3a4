"""The shared memory of senders that are gone: freed, however many receivers map it."""

from __future__ import annotations

import fcntl
import mmap
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from heel.services.runtime.counters import ServiceStatistics
from heel.services.runtime.shared_memory import (
    GRACE_S,
    LEAST_POOL_BYTES,
    Ledger,
    SharedMemoryWatch,
    Sweeper,
    full_share,
    remove_own_segments,
    unlock_nameless,
)
from tests.support.network import DEADLINE_S

POOL_BYTES = LEAST_POOL_BYTES + 8
SENDER = """
import os, sys
from pathlib import Path
from heel.services.runtime.shared_memory import Ledger
folder = Path(sys.argv[1])
ledger = Ledger(folder)
with ledger.claiming():
    segment = os.open(folder / sys.argv[2], os.O_RDWR | os.O_CREAT, 0o600)
    os.pwrite(segment, b"p" * int(sys.argv[3]), 0)
print("there", flush=True)
sys.stdin.read()
"""


@contextmanager
def sender(folder: Path, name: str, size: int = POOL_BYTES) -> Iterator[subprocess.Popen[bytes]]:
    """A process with a segment of its own, until the end of the block."""
    command = [sys.executable, "-c", SENDER, str(folder), name, str(size)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"there\n"
        try:
            yield process
        finally:
            process.kill()
            process.wait(DEADLINE_S)


def test_memory_of_a_sender_that_is_gone_is_freed_under_who_maps_it(tmp_path: Path) -> None:
    segment, sweeper = tmp_path / "77.zenoh", Sweeper(tmp_path)
    with sender(tmp_path, segment.name):
        with segment.open("r+b") as file:
            mapped = mmap.mmap(file.fileno(), POOL_BYTES)
            held = os.dup(file.fileno())
        assert sweeper.sweep(0.0) == 0
        assert mapped[:4] == b"pppp"
    assert sweeper.sweep(1.0) == 0
    assert segment.exists(), "frames of a sender that has just gone may still be read"
    assert sweeper.sweep(1.0 + GRACE_S) == 1
    assert not segment.exists()
    assert mapped[:4] == bytes(4), "the mapping stays, its memory does not"
    assert os.fstat(held).st_blocks <= 8
    assert not list(tmp_path.iterdir())
    os.close(held)
    mapped.close()


def test_a_sender_that_lives_keeps_its_memory_however_long(tmp_path: Path) -> None:
    sweeper = Sweeper(tmp_path)
    with sender(tmp_path, "77.zenoh"):
        for now_s in (0.0, 10.0, 1000.0):
            assert sweeper.sweep(now_s, grace_s=0.0) == 0
        assert (tmp_path / "77.zenoh").stat().st_size == POOL_BYTES


def test_small_segments_are_nobodys_and_stay(tmp_path: Path) -> None:
    """Two sessions greet each other by one of 12 kB, which is the router's as well."""
    with sender(tmp_path, "77.zenoh", size=12288):
        pass
    Sweeper(tmp_path).sweep(0.0, grace_s=0.0)
    assert (tmp_path / "77.zenoh").exists()


@pytest.mark.parametrize("name", ["../victim", "victim.txt", "/etc/victim", "1.zenoh/../../victim"])
def test_a_forged_ledger_frees_nothing_but_segments(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "shm"
    folder.mkdir()
    victims = [tmp_path / "victim", folder / "victim.txt"]
    for victim in victims:
        victim.write_bytes(b"precious")
    (folder / "heel-0123.ledger").write_text(f"{name}\n")
    Sweeper(folder).sweep(0.0, grace_s=0.0)
    assert [victim.read_bytes() for victim in victims] == [b"precious"] * 2


def test_a_link_in_place_of_a_segment_is_not_followed(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_bytes(b"precious")
    (tmp_path / "1.zenoh").symlink_to(victim)
    (tmp_path / "heel-0123.ledger").write_text("1.zenoh")
    Sweeper(tmp_path).sweep(0.0, grace_s=0.0)
    assert victim.read_bytes() == b"precious"


def test_a_pool_is_claimed_by_its_size(tmp_path: Path) -> None:
    ledger, mine, other = Ledger(tmp_path), tmp_path / "1.zenoh", tmp_path / "2.zenoh"
    with mine.open("w+b") as a, other.open("w+b") as b:
        a.truncate(POOL_BYTES)
        b.truncate(POOL_BYTES + 8)
        ledger.claim_by_size(POOL_BYTES)
    (written,) = tmp_path.glob("*.ledger")
    assert written.read_text() == "1.zenoh"
    mine.unlink()
    ledger.close()
    assert not written.exists()


def test_a_ledger_is_locked_from_its_first_moment(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path)
    with ledger.claiming(), (tmp_path / "1.zenoh").open("w+b") as segment:
        segment.truncate(POOL_BYTES)
        ledger.claim_by_size(POOL_BYTES)
    (written,) = tmp_path.glob("*.ledger")
    with written.open("rb") as file, pytest.raises(BlockingIOError):
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def test_a_ledger_goes_with_the_last_that_maps_its_memory_though_its_process_still_ends(
    tmp_path: Path,
) -> None:
    ledger, segment = Ledger(tmp_path), tmp_path / "1.zenoh"
    with ledger.claiming(), segment.open("w+b") as file:
        file.truncate(POOL_BYTES)
        ledger.claim_by_size(POOL_BYTES)
    ledger.close()
    assert list(tmp_path.glob("*.ledger")), "its memory is still there, mapped by another"
    segment.unlink()
    remove_own_segments(tmp_path)
    assert not list(tmp_path.iterdir())


def test_segments_without_a_name_are_not_locked_any_more(tmp_path: Path) -> None:
    segment = tmp_path / "5.zenoh"
    segment.write_bytes(bytes(1 << 16))
    with segment.open("r+b") as file:
        mapped = mmap.mmap(file.fileno(), 1 << 16)
    segment.unlink()
    unlock_nameless(tmp_path)
    mapped[0] = 1
    mapped.close()


def test_a_full_shared_memory_is_a_problem_that_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    statistics = ServiceStatistics()
    watch = SharedMemoryWatch(POOL_BYTES, statistics)
    monkeypatch.setattr("heel.services.runtime.shared_memory.full_share", lambda: 0.97)
    watch.look(0.0)
    (problem,) = statistics.problems()
    assert "/dev/shm is 97% full" in problem
    monkeypatch.setattr("heel.services.runtime.shared_memory.full_share", lambda: 0.4)
    watch.look(1.0)
    assert statistics.problems() == []
    assert statistics.details["shared_memory_full"] == "40%"


def test_a_machine_without_shared_memory_has_no_share_of_it(tmp_path: Path) -> None:
    assert full_share(tmp_path / "none") is None


def test_a_process_that_is_out_of_descriptors_sweeps_nothing_and_lives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(24, "Too many open files")

    monkeypatch.setattr(Path, "glob", full)
    assert Sweeper(tmp_path).sweep(0.0) == 0
