"""The emergency stop and the stream of commands, while a viewer hangs or has left the network."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import zenoh

from benchmarks.stopping.relay import Relay
from heel.schemas import EStop, encode, keys
from tests.support import network
from tests.support.driving import drive_process
from tests.support.network import wait_until
from tests.support.processes import running

FRAME = bytes(300_000)
LATE_S = 1.0
"""Before there were rules for the router it was 3 to 5 s, or never."""


@contextmanager
def frames(session: zenoh.Session) -> Iterator[None]:
    """Pictures at 20 Hz, as capture sends them."""
    publisher = session.declare_publisher(
        keys.image("front"), priority=zenoh.Priority.DATA_LOW, express=True,
        congestion_control=zenoh.CongestionControl.BLOCK_FIRST,
    )  # fmt: skip
    ending = threading.Event()

    def send() -> None:
        while not ending.wait(0.05):
            publisher.put(FRAME)

    thread = threading.Thread(target=send, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ending.set()
        thread.join(10.0)


@pytest.mark.parametrize("trouble", ["frozen", "gone"])
def test_a_viewer_in_trouble_costs_the_robot_nothing(trouble: str) -> None:
    """It subscribes to everything, first of all, and takes nothing: neither frames nor stops."""
    with network.router() as endpoint, Relay(int(endpoint.rpartition(":")[2])) as relay:
        # A relay takes what a frozen viewer behind it does not.
        address = endpoint if trouble == "frozen" else f"tcp/127.0.0.1:{relay.port}"
        with running("-m", "benchmarks.stopping.clients", "viewer", address) as viewer:
            wait_until(lambda: "up" in viewer.stdout(), "the viewer", 30.0)
            with (
                network.client(endpoint) as other, network.client(endpoint) as button,
                network.client(endpoint) as camera, frames(camera),
                drive_process(endpoint, other) as robot, robot.commanded(),
            ):  # fmt: skip
                wait_until(robot.drives, "driving")
                if trouble == "frozen":
                    viewer.process.send_signal(signal.SIGSTOP)
                else:
                    relay.stall()
                stood = False
                until_s = time.monotonic() + 2.0
                while time.monotonic() < until_s:
                    stood |= not robot.drives()
                    time.sleep(0.01)
                assert not stood, "the commands went on all the time"
                stop = EStop(engaged=True, source="a button", id="7" * 16)
                pressed_s = time.monotonic()
                button.put(
                    keys.FOLLOW_ESTOP, encode(stop), encoding=stop.encoding(), express=True,
                    priority=zenoh.Priority.REAL_TIME,
                    congestion_control=zenoh.CongestionControl.BLOCK,
                )  # fmt: skip
                wait_until(lambda: robot.stopped, "the stop")
                assert time.monotonic() - pressed_s < LATE_S
                viewer.process.send_signal(signal.SIGCONT)
