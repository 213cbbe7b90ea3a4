"""Telling systemd that a service is ready, and that its loop still comes round (sd_notify).

The protocol is one datagram of `NAME=value` lines to the Unix socket that systemd names; no package
that speaks it is kept up to date and needs no compiler. Without systemd this does nothing.
"""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Mapping
from contextlib import suppress

_SHARE = 0.25
"""Of the watchdog's time between two signs of life: systemd's manual asks for half of it at most;
chosen by hand."""
_LONGEST_TURN_S = 8.0
"""Longest turn [s] of a loop that does not hang: a busy machine has held up services that work on
pictures for so long."""
_LONGEST_CHEAP_TURN_S = 2.0
"""The same of loops without pictures, which take milliseconds; chosen by hand."""
_CHEAP = ("router", "follower", "drive")


class Notifier:
    """Speaks to the systemd that started this process.

    The watchdog tells two things by its one signal. A process that is frozen is silent at once. A
    loop that hangs is silent after its longest turn: until then a thread beside it speaks for it,
    so that the watchdog's time may be shorter than a turn on a busy machine.

    Args:
        environment: where systemd leaves its address and the watchdog's time.
        log: told once if the address cannot be spoken to.
        service: kind of process, which tells how long a turn may take.
    """

    def __init__(
        self, environment: Mapping[str, str], log: logging.Logger, service: str = ""
    ) -> None:
        self._log = log
        self._turn_s = _LONGEST_CHEAP_TURN_S if service in _CHEAP else _LONGEST_TURN_S
        self._came_round_s: float | None = None
        address = environment.get("NOTIFY_SOCKET", "")
        # @ stands for the zero byte of Linux's abstract addresses.
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        self._period_s = _watchdog_s(environment) * _SHARE
        self._due_s = 0.0
        self._status = ""

    def ready(self) -> None:
        """The service does its work from now on."""
        self._send("READY=1")

    def alive(self, now_s: float) -> None:
        """The loop came round; passed on as often as the watchdog needs it."""
        self._came_round_s = now_s
        self.beside(now_s)

    def beside(self, now_s: float) -> None:
        """From a thread beside the loop: the process lives, and its loop did a moment ago."""
        came_s = self._came_round_s
        if came_s is None or now_s - came_s > self._turn_s:
            return
        if self._period_s and now_s >= self._due_s:
            self._due_s = now_s + self._period_s
            self._send("WATCHDOG=1")

    def status(self, words: str) -> None:
        """What `systemctl status` shows, in one line; passed on when it changes."""
        if words != self._status:
            self._status = words
            self._send("STATUS=" + " ".join(words.split()))

    def stopping(self) -> None:
        """The service was told to end, or has nothing more to do."""
        self._send("STOPPING=1")

    def _send(self, line: str) -> None:
        if not self._address:
            return
        try:
            # Never waited for: a systemd that does not read must not hold up a loop.
            kind = socket.SOCK_DGRAM | socket.SOCK_CLOEXEC | socket.SOCK_NONBLOCK
            with socket.socket(socket.AF_UNIX, kind) as out:
                out.sendto(line.encode(), self._address)
        except BlockingIOError:
            pass  # Its queue is full; the next sign of life is soon due.
        except OSError as error:
            self._log.warning("systemd at %s: %s: it is told nothing", self._address, error)
            self._address = ""


def _watchdog_s(environment: Mapping[str, str]) -> float:
    """The watchdog's time, seconds; 0 where none is set or it is another process's."""
    if environment.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return 0.0
    with suppress(ValueError):
        return max(0, int(environment.get("WATCHDOG_USEC", "0"))) * 1e-6
    return 0.0
