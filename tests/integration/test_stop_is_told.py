"""An emergency stop of which the drive alone knows: every view of the robot has to tell of it."""

from __future__ import annotations

import importlib.util
import json
import threading
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import zenoh
from typer.testing import CliRunner

from heel.schemas import DriveState, EStop, FollowState, Target, decode, encode, keys
from heel.services.cli import app
from tests.support.network import DEADLINE_S, client, collected, free_port, router, wait_until
from tests.support.processes import running
from tests.support.web_page import web_process

_START_S = 60.0
_ROBOT = "r1"


@contextmanager
def follower_with(session: zenoh.Session, estop: bool) -> Iterator[None]:
    """States of a follower that stands or, having missed the stop, does not."""
    over = threading.Event()
    state = FollowState(
        seq=1, state="idle", reason="no target", estop=estop, linear_mps=0.0, angular_radps=0.0,
        target=Target(seq=0, mode="none"),
    )  # fmt: skip

    def speak() -> None:
        while not over.wait(0.1):
            key = f"{_ROBOT}/{keys.FOLLOW_STATE}"
            session.put(key, encode(state), encoding=state.encoding())

    speaking = threading.Thread(target=speak, daemon=True)
    speaking.start()
    try:
        yield
    finally:
        over.set()
        speaking.join(5.0)


def asked(url: str) -> Any:
    with urllib.request.urlopen(url, timeout=DEADLINE_S) as answer:
        return json.loads(answer.read())


def heel(*arguments: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, list(arguments))
    return done.exit_code, done.stdout


def robots_page(url: str) -> dict[str, Any]:
    return next((one for one in asked(f"{url}/api/robots")["robots"] if one["name"] == _ROBOT), {})


def figure(port: int) -> float:
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=DEADLINE_S) as answer:
        lines = answer.read().decode().splitlines()
    found = [line.split()[1] for line in lines if line.startswith("heel_emergency_stop{")]
    return float(found[0]) if found else -1.0


def press(session: zenoh.Session, states: Any) -> None:
    """Stop the drive, and wait until it says so."""
    estop = EStop(engaged=True, source="test", id="0123456789abcdef")

    def stopped() -> bool:
        session.put(f"{_ROBOT}/{keys.FOLLOW_ESTOP}", encode(estop), encoding=estop.encoding())
        sample = states.get(timeout=_START_S)
        while not states.empty():
            sample = states.get()
        return decode(DriveState, sample.payload.to_bytes(), str(sample.encoding)).estop

    wait_until(stopped, "the drive stands", _START_S)


def test_a_stop_that_the_drive_alone_holds_is_told_by_every_view(tmp_path: Path) -> None:
    port, metrics = free_port(), importlib.util.find_spec("prometheus_client") is not None
    drive = ["-m", "heel.services.drive", "--driver", "log", "--namespace", _ROBOT]
    drive += ["--metrics-port", str(port)] if metrics else []
    with router() as endpoint, client(endpoint) as session, ExitStack() as stack:
        connected = ("--connect", endpoint, "--namespace", _ROBOT)
        stack.enter_context(running(*drive, "--connect", endpoint, HEEL_RUNTIME_DIR=str(tmp_path)))
        robots, _ = stack.enter_context(web_process(endpoint, "--robots", "all"))
        page, _ = stack.enter_context(web_process(endpoint, "--namespace", _ROBOT))
        states = stack.enter_context(collected(session, f"{_ROBOT}/{keys.ROBOT_DRIVE}"))
        states.get(timeout=_START_S)
        wait_until(lambda: robots_page(robots).get("estop") is False, "no stop yet", _START_S)
        _, told = heel("status", *connected)
        assert "EMERGENCY STOP" not in told
        press(session, states)

        code, told = heel("status", *connected)
        assert "EMERGENCY STOP: the drive holds it; no follower is heard" in told, told
        _, told = heel("status", "--json", *connected)
        found = json.loads(told)
        assert (found["estop"], found["drive"]["estop"], found["follower"]) == (True, True, None)
        _, told = heel("status", "--all", "--connect", endpoint)
        assert " STOP " in told.splitlines()[1], told
        _, told = heel("top", "--count", "1", *connected)
        assert "EMERGENCY STOP: the drive holds it" in told, told
        # A low terminal cuts off the end of the table.
        assert told.index("EMERGENCY STOP") < told.index("latency ms"), told
        wait_until(lambda: robots_page(robots)["estop"], "the page of robots", DEADLINE_S)
        stop = asked(f"{page}/api/state")["stop"]
        assert (stop["engaged"], stop["confirmed_by"]) == (True, "drive")
        if metrics:
            wait_until(lambda: figure(port) == 1.0, "Prometheus", DEADLINE_S)

        with follower_with(session, estop=False):
            code, told = heel("status", *connected)
            assert (code, "the drive holds it, the follower does not" in told) == (1, True), told
            code, told = heel("status", "--all", "--connect", endpoint)
            assert (code, "drive only" in told) == (1, True), told
            wait_until(
                lambda: robots_page(robots)["estop_of"] == {"drive": True, "follower": False},
                "the page of robots", DEADLINE_S,
            )  # fmt: skip
