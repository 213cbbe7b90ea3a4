"""A real service tells systemd that it is ready and alive, and says nothing once its loop hangs."""

from __future__ import annotations

import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support import network
from tests.support.processes import Running, running

pytestmark = pytest.mark.timeout(60)

WATCHDOG_S = 0.8
HANGS = """
import sys, threading, time
from heel.services.runtime.service import run_service
from heel.services.runtime.settings import ServiceSettings, load_settings

def main(context):
    context.announce()
    began = time.monotonic()
    while context.running:
        if context.inbox.get(0.1) is None and context.statistics.last_loop_s - began > 2.0:
            threading.Event().wait(60)

loaded = load_settings("tracker", ServiceSettings, {"zenoh": {"connect": sys.argv[1]}})
run_service("drive", loaded, main)
"""
"""A service whose loop hangs after two seconds; its other threads go on. It calls itself a drive,
whose turns may take no longer than two seconds more."""


class Systemd:
    """Listens at the address that services are given, and keeps when what was said."""

    def __init__(self, listener: socket.socket) -> None:
        self._listener = listener
        listener.setblocking(False)
        self.said: list[tuple[str, float]] = []

    def look(self) -> None:
        """Take what has come."""
        while True:
            try:
                line = self._listener.recv(4096).decode()
            except BlockingIOError:
                return
            self.said.append((line, time.monotonic()))

    def count(self, line: str) -> int:
        """How often a line came up to now."""
        self.look()
        return sum(one == line for one, _ in self.said)

    def silent_s(self) -> float:
        """Since when no sign of life came."""
        self.look()
        return time.monotonic() - max(t_s for line, t_s in self.said if line == "WATCHDOG=1")


@pytest.fixture
def systemd(tmp_path: Path) -> Iterator[Systemd]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "notify"))
        yield Systemd(listener)


def watched(systemd: Systemd, process: Running, times: int = 4) -> None:
    """Wait until the service is ready and has shown signs of life so many times."""
    network.wait_until(lambda: systemd.count("READY=1") == 1, "ready", 20.0)
    enough = systemd.count("WATCHDOG=1") + times
    network.wait_until(lambda: systemd.count("WATCHDOG=1") >= enough, "signs of life", 20.0)
    assert process.alive


def environment(tmp_path: Path) -> dict[str, str]:
    return {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": f"{WATCHDOG_S * 1e6:.0f}"}


def test_a_service_shows_signs_of_life_until_it_is_frozen_and_says_when_it_ends(
    systemd: Systemd, tmp_path: Path
) -> None:
    with network.router() as endpoint:
        service = ("-m", "heel.services.tracker", "--connect", endpoint)
        with running(*service, **environment(tmp_path)) as process:
            watched(systemd, process)
            process.process.send_signal(signal.SIGSTOP)
            network.wait_until(lambda: systemd.silent_s() > 2 * WATCHDOG_S, "silence", 10.0)
            process.process.send_signal(signal.SIGCONT)
            watched_again = systemd.count("WATCHDOG=1") + 1
            network.wait_until(lambda: systemd.count("WATCHDOG=1") >= watched_again, "life again")
            process.stop(signal.SIGTERM, 10.0)
    assert systemd.count("STOPPING=1") == 1
    assert any(line.startswith("STATUS=ok") for line, _ in systemd.said)


def test_a_loop_that_hangs_is_seen_though_the_process_lives(
    systemd: Systemd, tmp_path: Path
) -> None:
    with network.router() as endpoint:
        with running("-c", HANGS, endpoint, **environment(tmp_path)) as process:
            watched(systemd, process)
            network.wait_until(lambda: systemd.silent_s() > 2 * WATCHDOG_S, "silence", 20.0)
            assert process.alive
            # Its health goes on, and says so.
            hung = "the service loop has hung"
            network.wait_until(
                lambda: systemd.look() or any(hung in line for line, _ in systemd.said), hung
            )


def test_the_router_is_watched_too(systemd: Systemd, tmp_path: Path) -> None:
    router = ("-m", "heel", "router", "--listen", "tcp/127.0.0.1:0")
    with running(*router, **environment(tmp_path)) as process:
        watched(systemd, process, 1)
