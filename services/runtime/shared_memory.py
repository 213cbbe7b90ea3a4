"""What Zenoh leaves in shared memory when a process ends, and how it is given back.

A receiver maps each sender's pool and never lets go of it (Zenoh issue 2787): the pool of a sender
that restarts stays locked in the router and in every receiver, 37 MB a restart of a 1080p camera.
So each sender writes down which segments are its own, in a ledger on which it holds a file lock for
as long as it lives. The others look through the ledgers once in a while: the memory of a
sender that is gone is freed (its mappings stay valid and read as zeros), and mappings of segments
without a name are no longer locked.

The ledgers lie beside the segments: containers share `/dev/shm` and nothing else, and see neither
each other's process numbers nor each other's `/tmp`.
"""

from __future__ import annotations

import ctypes
import fcntl
import math
import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # numpy, which that imports, starts threads: not before `run.guard` has forked
    from heel.services.runtime.counters import ServiceStatistics

SHARED_MEMORY = Path("/dev/shm")
GRACE_S = 2.0
"""A sender is gone for so long before its memory is freed: receivers have read its last frames by
then (a ring holds one or two of them, and the detector takes less than 0.2 s for each)."""
WATCH_PERIOD_S = 1.0
"""Seconds between two looks at shared memory; chosen by hand."""
FULL_SHARE = 0.9
"""Of shared memory in use, from which on a service says so; chosen by hand."""
LEAST_POOL_BYTES = 1 << 20
"""Pools and their index are larger; the segments that two sessions greet each other by (12 kB) are
the router's as well and go by themselves."""
_SEGMENT = re.compile(r"[0-9]{1,20}\.zenoh")
_LEDGER = "heel-*.ledger"
_MOST_LEDGER_BYTES = 4096
"""Of a ledger that is read; ours name a few segments."""
_FALLOC_FL_KEEP_SIZE = 1
"""Of Linux, linux/falloc.h."""
_FALLOC_FL_PUNCH_HOLE = 2
"""Of Linux, linux/falloc.h."""


class Ledger:
    """The segments of this process, written where others find them when it is gone."""

    def __init__(self, folder: Path = SHARED_MEMORY) -> None:
        self._folder = folder
        self._file: Path | None = None
        self._descriptor = -1
        self._own: set[str] = set()

    @contextmanager
    def claiming(self) -> Iterator[None]:
        """Pools that this process opens within are its own."""
        before = set(self._open())
        try:
            yield
        finally:
            self._claim(set(self._open()) - before)

    def claim_by_size(self, size_bytes: int) -> None:
        """Claim the open segments of a size that no other process chose for its pool."""
        self._claim({name for name, size in self._open().items() if size == size_bytes})

    def close(self) -> None:
        """Delete this process's ledger if nothing of what it lists is left, or leave it to others.

        The lock goes before that is looked at: who deletes the last segment either finds the ledger
        to be of nobody, or has deleted it before this process looks.
        """
        if self._file is None:
            return
        file, self._file = self._file, None
        names, self._own = self._own, set()
        with suppress(OSError):
            os.close(self._descriptor)
            if not any((self._folder / name).exists() for name in names):
                file.unlink()

    def _claim(self, names: set[str]) -> None:
        if names <= self._own:
            return
        self._own |= names
        with suppress(OSError):  # a full /dev/shm: what is not listed is freed by Zenoh, later
            if self._file is None:
                self._begin()
            os.pwrite(self._descriptor, "\n".join(sorted(self._own)).encode(), 0)

    def _begin(self) -> None:
        """Create the file, and lock it before another can take it for that of a dead process."""
        name = f"heel-{secrets.token_hex(8)}"
        flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
        self._descriptor = os.open(self._folder / name, flags, 0o600)
        fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._file = self._folder / f"{name}.ledger"
        os.rename(self._folder / name, self._file)

    def _open(self) -> dict[str, int]:
        return {name: size for name, size in _open_segments(self._folder).items()
                if size >= LEAST_POOL_BYTES}  # fmt: skip


OWN = Ledger()
"""That of this process."""


class Sweeper:
    """Frees what senders that are gone have left, seen again and again by `sweep`."""

    def __init__(self, folder: Path = SHARED_MEMORY) -> None:
        self._folder = folder
        self._gone_since_s: dict[Path, float] = {}

    def sweep(self, now_s: float, grace_s: float = GRACE_S) -> int:
        """Free what was left `grace_s` ago; returns how many segments that were.

        Args:
            now_s: monotonic time.
            grace_s: 0 where no process can be reading any more.
        """
        try:
            return self._sweep(now_s, grace_s)
        except OSError:
            # A process that is out of descriptors frees nothing for now; it must not end of that.
            return 0

    def _sweep(self, now_s: float, grace_s: float) -> int:
        freed = 0
        gone = {ledger: _names_of_the_gone(ledger) for ledger in self._folder.glob(_LEDGER)}
        for ledger, names in gone.items():
            if names is None:
                continue
            since_s = self._gone_since_s.setdefault(ledger, now_s)
            left = [name for name in names if (self._folder / name).exists()]
            if left and now_s - since_s < grace_s:
                continue
            freed += sum(_free(self._folder / name) for name in left)
            with suppress(OSError):
                ledger.unlink()
        self._gone_since_s = {
            ledger: since_s for ledger, since_s in self._gone_since_s.items()
            if gone.get(ledger) is not None
        }  # fmt: skip
        unlock_nameless(self._folder)
        return freed


class SharedMemoryWatch:
    """What a service does for shared memory once a second: claim, sweep, and say how full it is."""

    def __init__(self, pool_bytes: int, statistics: ServiceStatistics) -> None:
        """Watch for a process whose pool of results, once there is one, has this very size."""
        self._pool_bytes = pool_bytes
        self._statistics = statistics
        self._sweeper = Sweeper()
        self._last_s = -math.inf

    def look(self, now_s: float) -> None:
        """Once round, at a monotonic time; more often than once a second changes nothing."""
        if now_s - self._last_s < WATCH_PERIOD_S:
            return
        self._last_s = now_s
        OWN.claim_by_size(self._pool_bytes)
        self._sweeper.sweep(now_s)
        share = full_share()
        if share is None:
            return
        self._statistics.details["shared_memory_full"] = f"{share:.0%}"
        self._statistics.problem(
            "shared memory full",
            f"{SHARED_MEMORY} is {share:.0%} full: make it larger, or delete what does not belong "
            "there; new frames and services go without it" if share > FULL_SHARE else None,
        )  # fmt: skip


def full_share(folder: Path = SHARED_MEMORY) -> float | None:
    """Share of the shared memory in use, 0 to 1; None where there is none."""
    try:
        status = os.statvfs(folder)
    except OSError:
        return None
    return 1.0 - status.f_bavail / status.f_blocks if status.f_blocks else None


def free_bytes(folder: Path = SHARED_MEMORY) -> int | None:
    """Shared memory that is left; None where there is none at all."""
    try:
        status = os.statvfs(folder)
    except OSError:
        return None
    return status.f_bavail * status.f_frsize


def remove_own_segments(folder: Path = SHARED_MEMORY) -> None:
    """Delete the Zenoh segments that only this process, which is about to end, holds.

    Zenoh leaves its pools and their index behind and removes them when the next session on the
    machine starts. Each process that maps a segment keeps a shared lock on its file: the last
    one alone can make its own exclusive. One that ends before leaves the segment to the rest.
    """
    for name, descriptor in _segment_descriptors(folder):
        with suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            (folder / name).unlink()
    OWN.close()
    for ledger in folder.glob(_LEDGER):
        names = _names_of_the_gone(ledger)
        if names is not None and not any((folder / name).exists() for name in names):
            with suppress(OSError):
                ledger.unlink()


def unlock_nameless(folder: Path = SHARED_MEMORY) -> None:
    """Unlock mapped segments that have no file any more: what is locked counts against a limit.

    The mapping itself stays: it is Zenoh's, and there is no telling whether it looks there again.
    """
    with suppress(OSError, AttributeError):
        libc = ctypes.CDLL(None)
        for line in Path("/proc/self/maps").read_text().splitlines():
            if f" {folder}/" in line and line.endswith(".zenoh (deleted)"):
                first, last = (int(end, 16) for end in line.split(" ", 1)[0].split("-"))
                libc.munlock(ctypes.c_void_p(first), ctypes.c_size_t(last - first))


def _segment_descriptors(folder: Path) -> Iterator[tuple[str, int]]:
    with suppress(OSError):
        for descriptor in os.listdir("/proc/self/fd"):
            with suppress(OSError):
                parent, _, name = os.readlink(f"/proc/self/fd/{descriptor}").rpartition("/")
                if parent == str(folder) and _SEGMENT.fullmatch(name):
                    yield name, int(descriptor)


def _open_segments(folder: Path) -> dict[str, int]:
    sizes = {}
    for name, descriptor in _segment_descriptors(folder):
        with suppress(OSError):
            sizes[name] = os.fstat(descriptor).st_size
    return sizes


def _names_of_the_gone(ledger: Path) -> list[str] | None:
    """What a ledger lists if its process is gone; None while it lives, or if it is no ledger."""
    try:
        descriptor = os.open(ledger, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError:
        return None
    try:
        if os.fstat(descriptor).st_uid != os.geteuid():
            return None
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        text = os.read(descriptor, _MOST_LEDGER_BYTES).decode(errors="replace")
        return [name for name in text.split("\n") if _SEGMENT.fullmatch(name)]
    except OSError:
        return None
    finally:
        os.close(descriptor)


def _free(segment: Path) -> bool:
    """Give a segment's memory back although others map it; false if it is gone or not ours."""
    try:
        descriptor = os.open(segment, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        size = os.fstat(descriptor).st_size
        segment.unlink()
        libc = ctypes.CDLL(None, use_errno=True)
        libc.fallocate.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64]
        libc.fallocate(descriptor, _FALLOC_FL_PUNCH_HOLE | _FALLOC_FL_KEEP_SIZE, 0, size)
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return True
