"""This process: its memory, its processor time, its allocator, its version."""

from __future__ import annotations

import ctypes
import functools
import gc
import logging
import os
import resource
import signal
import sys
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from typing import NoReturn

from heel.services.runtime.shared_memory import remove_own_segments

_PR_SET_PDEATHSIG = 1
"""Of Linux, linux/prctl.h."""
PARENT_VARIABLE = "HEEL_PARENT_PID"
_M_TRIM_THRESHOLD = -1
"""Of glibc, malloc.h."""
_M_MMAP_THRESHOLD = -3
"""Of glibc, malloc.h."""
_CAP_IPC_LOCK = 14
"""Of Linux, linux/capability.h."""
_MOST_LOCKED_BYTES = 256 << 20
"""Pools of three cameras of 1080p, and of all that work on them."""


def keep_freed_memory() -> None:
    """Stop glibc from giving frame-sized blocks back to the kernel after every frame.

    By default each 1.3 MB frame costs 616 page faults, the largest single cost of a hop: 25
    frames/s aged 2.2 ms by default and 1.0 ms with the blocks kept. Elsewhere than glibc this
    does nothing.
    """
    try:
        libc = ctypes.CDLL(None)
        libc.mallopt(_M_TRIM_THRESHOLD, 128 << 20)
        libc.mallopt(_M_MMAP_THRESHOLD, 32 << 20)
    except (OSError, AttributeError):
        return


def use_all_file_descriptors() -> None:
    """Raise the soft limit on open files to the hard one.

    Each restart of a sender costs its receivers three descriptors (see `shared_memory`), and each
    connection to a router one; the usual soft limit of 1,024 is there for programs that `select`.
    """
    with suppress(OSError, ValueError):
        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def spare_from_collection() -> None:
    """Exempt all objects there are by now from garbage collection: they live as long as we do.

    Looking through what the imports leave behind took 50 to 70 ms, one or two dropped frames, in
    every service once soon after the first frame.
    """
    gc.freeze()


def die_with_parent() -> None:
    """End this process when the one that started it ends, even by SIGKILL (Linux).

    Only where `HEEL_PARENT_PID` asks for it, as `heel run` and `heel demo` do for their children.
    """
    parent = os.environ.get(PARENT_VARIABLE)
    if parent is None:
        return
    try:
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    except (OSError, AttributeError):
        return
    if os.getppid() != int(parent):
        # The parent was gone before the kernel was told.
        os.kill(os.getpid(), signal.SIGTERM)


def open_standard_streams() -> None:
    """Put `/dev/null` in the place of standard streams that were closed (`heel status >&-`).

    Python has None for them, which nobody expects; and the next file or socket would get the number
    of standard error, to which libraries in C write.
    """
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        try:
            os.fstat(number)
        except OSError:
            # The least number that is free, and those below are taken by now.
            os.open(os.devnull, os.O_RDWR)
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115


def leave(code: int) -> NoReturn:
    """End this process without Python taking itself apart first.

    Five services told to end at once took 0.4 to 1.2 s each on two busy cores, almost all of it
    freeing objects, and 0.1 s this way. The C library's exit still runs the handler by which
    Zenoh removes its shared memory, which `os._exit` leaves behind (measured).
    """
    logging.shutdown()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    remove_own_segments()
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).exit(code)
    os._exit(code)


def may_lock_memory() -> bool:
    """Whether this process may lock as much memory as shared memory may ever ask for.

    Zenoh locks every segment that it makes or maps. A sender that may and a receiver that may not
    lose messages between them (measured with the usual limit of 8 MiB, which two or three pools
    reach; Zenoh issue 2788), so it is all or nothing.
    """
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    return limit == resource.RLIM_INFINITY or limit >= _MOST_LOCKED_BYTES or _may_ignore_limit()


def _may_ignore_limit() -> bool:
    with suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            name, _, rest = line.partition(":")
            if name == "CapEff":
                return bool(int(rest, 16) >> _CAP_IPC_LOCK & 1)
    return False


def cpu_s() -> float:
    """Processor seconds used so far, user and system."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def memory_mb(pid: int | None = None) -> tuple[float, float]:
    """Resident and peak resident size in MB; zeros where /proc is missing or the process is."""
    values = {"VmRSS": 0.0, "VmHWM": 0.0}
    try:
        status = Path(f"/proc/{pid or os.getpid()}/status").read_text()
    except OSError:
        return 0.0, 0.0
    for line in status.splitlines():
        name, _, rest = line.partition(":")
        if name in values:
            values[name] = float(rest.split()[0]) / 1024.0
    return values["VmRSS"], values["VmHWM"]


@functools.cache
def software_version() -> str:
    """The installed distribution's version."""
    try:
        return metadata.version("heel-follow")
    except metadata.PackageNotFoundError:
        return "unknown"
