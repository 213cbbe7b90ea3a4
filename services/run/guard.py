"""A guard around a run: however it ends, no process and no shared memory stays behind."""

from __future__ import annotations

import ctypes
import fcntl
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from heel.schemas.errors import HeelError, SettingsError
from heel.services.runtime.logs import printable
from heel.services.runtime.shared_memory import SHARED_MEMORY, Sweeper

# Options of prctl(2), numbers of <linux/prctl.h>.
_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36

_REAP_S = 5.0
"""Longest wait [s] for services whose run was killed; above `EXIT_DEADLINE_S`, within which a
service ends itself; chosen by hand."""


def guarded(work: Callable[[], None]) -> int:
    """Run `work` in a forked process and clean up after it; returns its exit code.

    The guard itself never opens Zenoh: a process that did keeps its shared memory segments locked
    until it is gone (measured: a 16 MiB pool and its index stay after a clean exit). Services that
    lose the run's process become children of the guard, which waits for them. Must be called
    before Zenoh is imported and before any thread is started.
    """
    libc = ctypes.CDLL(None)
    libc.prctl(_PR_SET_CHILD_SUBREAPER, 1)
    sys.stdout.flush()
    sys.stderr.flush()
    guard = os.getpid()
    pid = os.fork()
    if pid == 0:
        libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != guard:
            os._exit(1)
        os._exit(_worker(work))
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda n, _frame: _forward(pid, n))
    _, status = os.waitpid(pid, 0)
    _reap_orphans()
    Sweeper().sweep(time.monotonic(), grace_s=0.0)
    remove_orphaned_segments()
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        sys.stderr.write(f"heel: the run was killed by signal {-code}; its files are kept\n")
        return 1
    return code


def _worker(work: Callable[[], None]) -> int:
    code = 0
    try:
        work()
    except HeelError as error:
        sys.stderr.write(f"heel: {printable(str(error))}\n")
        code = 2 if isinstance(error, SettingsError) else 1
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 1
    except BaseException:
        sys.excepthook(*sys.exc_info())
        code = 1
    # The reader may be gone (`heel run ... | head`): then there is no reader left.
    with suppress(BrokenPipeError):
        sys.stdout.flush()
    sys.stderr.flush()
    return code


def _forward(pid: int, number: int) -> None:
    # Ctrl-C reaches the whole foreground group already; a second SIGINT changes nothing.
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return


def _reap_orphans() -> None:
    """Wait for services that outlived the run's process; the kernel has sent them SIGTERM."""
    # Blocked first: an end between looking and waiting then stays pending instead of being missed.
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGCHLD})
    deadline_s = time.monotonic() + _REAP_S
    while (remaining_s := deadline_s - time.monotonic()) > 0:
        try:
            pid, _ = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return
        if pid == 0:
            signal.sigtimedwait({signal.SIGCHLD}, remaining_s)


def remove_orphaned_segments(folder: Path = SHARED_MEMORY) -> int:
    """Delete Zenoh's shared memory segments that no living process holds; returns how many.

    Zenoh keeps a file lock on every segment in use and removes the unlocked ones itself, but only
    when the next session on the machine starts.
    """
    removed = 0
    for segment in folder.glob("*.zenoh"):
        try:
            descriptor = os.open(segment, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC)
        except OSError:
            continue
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            segment.unlink()
            removed += 1
        except OSError:
            continue
        finally:
            os.close(descriptor)
    return removed
