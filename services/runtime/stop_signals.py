"""SIGTERM and Ctrl-C: an event for those who wait, and an end that always comes."""

from __future__ import annotations

import faulthandler
import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

EXIT_DEADLINE_S = 1.7
"""Longest time from a signal to the end of the process, however stuck it is."""
_ENDING = (signal.SIGTERM, signal.SIGINT)


@contextmanager
def stop_signals(exit_deadline_s: float = EXIT_DEADLINE_S) -> Iterator[threading.Event]:
    """An event that SIGTERM and SIGINT set; a process that then hangs is ended by force.

    The event is set by a thread that the signal wakes through a socket (`signal.set_wakeup_fd`).
    A Python signal handler would run inside whatever the main thread is at: within `Event.wait`
    it would wait for ever for the lock that the main thread holds (1 process of 150 that did
    nothing but wait), and within a native call that does not return it would not run at all.

    To be entered by the main thread.
    """
    stop = threading.Event()
    woken, wakes = socket.socketpair()
    wakes.setblocking(False)

    def watch() -> None:
        while numbers := woken.recv(64):
            if not stop.is_set() and any(number in _ENDING for number in numbers):
                stop.set()
                end_within(exit_deadline_s)

    watcher = threading.Thread(target=watch, name="stop signals", daemon=True)
    watcher.start()
    wakened = signal.set_wakeup_fd(wakes.fileno(), warn_on_full_buffer=False)
    handlers = {number: signal.signal(number, _woken_is_enough) for number in _ENDING}
    try:
        yield stop
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(wakened)
        wakes.close()
        watcher.join()
        woken.close()


def _woken_is_enough(_number: int, _frame: object) -> None:
    """A signal without a handler does not write to the wakeup descriptor."""


def end_within(deadline_s: float) -> None:
    """See to it that this process ends, with exit code 1 if it takes longer than the deadline."""
    watchdog = threading.Timer(deadline_s, _end_by_force)
    watchdog.daemon = True
    watchdog.start()


def _end_by_force() -> None:
    # Zenoh can hang while closing a session without a router; where it hung is worth a look.
    sys.stderr.write("forced exit: the service did not end in time\n")
    faulthandler.dump_traceback(file=sys.stderr)
    os._exit(1)
