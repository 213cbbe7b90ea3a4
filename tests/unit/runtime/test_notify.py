"""What systemd is told, and how often."""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from heel.services.runtime.notify import Notifier

LOG = logging.getLogger("heel.test")


@pytest.fixture
def systemd(tmp_path: Path) -> Iterator[socket.socket]:
    """The end that systemd listens at."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "notify"))
        listener.setblocking(False)
        yield listener


def told(listener: socket.socket) -> list[str]:
    lines = []
    while True:
        try:
            lines.append(listener.recv(4096).decode())
        except BlockingIOError:
            return lines


def test_signs_of_life_come_four_times_in_the_watchdogs_time(systemd: socket.socket) -> None:
    notifier = Notifier({"NOTIFY_SOCKET": systemd.getsockname(), "WATCHDOG_USEC": "2000000"}, LOG)
    notifier.ready()
    for turn in range(100):
        notifier.alive(turn * 0.02)
    notifier.stopping()
    assert told(systemd) == ["READY=1", *["WATCHDOG=1"] * 4, "STOPPING=1"]


@pytest.mark.parametrize(
    "watchdog",
    [{}, {"WATCHDOG_USEC": "0"}, {"WATCHDOG_USEC": "soon"},
     {"WATCHDOG_USEC": "2000000", "WATCHDOG_PID": str(os.getpid() + 1)}],
)  # fmt: skip
def test_no_watchdog_is_fed_where_none_waits_for_this_process(
    systemd: socket.socket, watchdog: dict[str, str]
) -> None:
    Notifier({"NOTIFY_SOCKET": systemd.getsockname()} | watchdog, LOG).alive(5.0)
    assert told(systemd) == []


def test_the_state_is_told_when_it_changes_in_one_line(systemd: socket.socket) -> None:
    notifier = Notifier({"NOTIFY_SOCKET": systemd.getsockname()}, LOG)
    for words in ("ok ", "ok ", "degraded no tracks\nfor 2 s", "ok "):
        notifier.status(words)
    assert told(systemd) == ["STATUS=ok", "STATUS=degraded no tracks for 2 s", "STATUS=ok"]


def test_an_abstract_address_is_spoken_to() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind("")  # the kernel chooses an abstract one
        address = "@" + listener.getsockname().decode()[1:]
        Notifier({"NOTIFY_SOCKET": address}, LOG).ready()
        assert told_soon(listener) == "READY=1"


def told_soon(listener: socket.socket) -> str:
    listener.settimeout(1.0)
    return listener.recv(4096).decode()


def test_a_systemd_that_is_gone_is_complained_of_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    notifier = Notifier({"NOTIFY_SOCKET": str(tmp_path / "gone")}, LOG)
    notifier.ready()
    notifier.ready()
    assert len(caplog.records) == 1


def test_a_systemd_that_does_not_read_holds_nothing_up(systemd: socket.socket) -> None:
    notifier = Notifier({"NOTIFY_SOCKET": systemd.getsockname()}, LOG)
    for _ in range(3000):
        notifier.ready()
    assert set(told(systemd)) == {"READY=1"}


def test_without_systemd_nothing_is_sent() -> None:
    notifier = Notifier({}, LOG)
    notifier.ready()
    notifier.alive(1.0)


@pytest.mark.parametrize(("service", "longest_s"), [("drive", 2.0), ("detector", 8.0)])
def test_a_thread_beside_speaks_for_a_loop_no_longer_than_its_longest_turn(
    systemd: socket.socket, service: str, longest_s: float
) -> None:
    """Else a loop that hangs is never seen, or a busy one is killed."""
    environment = {"NOTIFY_SOCKET": systemd.getsockname(), "WATCHDOG_USEC": "2000000"}
    notifier = Notifier(environment, LOG, service)
    notifier.beside(50.0)
    assert told(systemd) == [], "the loop has yet to come round once"
    notifier.alive(100.0)
    assert told(systemd) == ["WATCHDOG=1"]
    notifier.beside(100.0 + longest_s - 0.1)
    assert told(systemd) == ["WATCHDOG=1"]
    notifier.beside(100.0 + longest_s + 0.1)
    assert told(systemd) == []
    notifier.alive(100.0 + longest_s + 1.0)
    assert told(systemd) == ["WATCHDOG=1"]
