"""Followers that take over from each other: the person chosen and the emergency stop are kept."""

from __future__ import annotations

import signal
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import pytest
import zenoh
from typer.testing import CliRunner

from heel.schemas import EStop, Health, MotionCommand, Stamp, decode, keys
from heel.services.cli import app
from heel.services.runtime.chain import STANDBY
from tests.integration.test_follower_service import Robot
from tests.support import network
from tests.support.processes import Running, running

_START_S = 40.0
STOP = EStop(engaged=True, source="a test", t_ns=1, id="0a")


class Followers:
    """What followers say of themselves, and every command with its sender."""

    def __init__(self, session: zenoh.Session, resources: ExitStack) -> None:
        self.health: dict[str, Health] = {}
        self.commands: list[tuple[str, MotionCommand, float]] = []
        for key, take in ((keys.ALL_HEALTH, self._note), (keys.FOLLOW_COMMAND, self._hear)):
            resources.callback(session.declare_subscriber(key, take).undeclare)

    def _note(self, sample: zenoh.Sample) -> None:
        health = decode(Health, sample.payload.to_bytes())
        self.health[health.instance] = health

    def _hear(self, sample: zenoh.Sample) -> None:
        assert sample.attachment is not None
        sender = decode(Stamp, sample.attachment.to_bytes()).producer
        command = decode(MotionCommand, sample.payload.to_bytes(), str(sample.encoding))
        self.commands.append((sender.partition("@")[0], command, time.monotonic()))

    def ready(self) -> str | None:
        """The instance that could take over at once."""
        return next(
            (name for name, health in self.health.items()
             if health.state != "ended" and health.details.get(STANDBY, "").startswith("ready")),
            None,
        )  # fmt: skip

    def leader(self) -> str:
        """The one that sent the newest command."""
        return self.commands[-1][0].partition("/")[2]

    def last_s(self, name: str) -> float:
        """When its newest command came."""
        return max(t_s for who, _, t_s in self.commands if who == f"follower/{name}")

    def first_s(self, name: str) -> float:
        """When its first command came."""
        return min(t_s for who, _, t_s in self.commands if who == f"follower/{name}")


@pytest.mark.slow
def test_followers_take_over_with_the_person_and_the_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HEEL_RUNTIME_DIR", str(tmp_path))

    def standby(name: str) -> Running:
        return resources.enter_context(
            running("-m", "heel.services.follower", "--connect", endpoint, "--standby",
                    "--instance", name, HEEL_RUNTIME_DIR=str(tmp_path))
        )  # fmt: skip

    with ExitStack() as resources, ThreadPoolExecutor(1) as beside:
        endpoint = resources.enter_context(network.router())
        other = standby("b")
        robot = Robot(endpoint, resources, "--standby", "--instance", "a")
        processes = {"a": robot.process, "b": other}
        followers = Followers(robot.session, resources)
        robot.until("one of the two leads", lambda _: bool(followers.commands))
        first = followers.leader()
        second = "b" if first == "a" else "a"
        assert robot.follow().target.track_id == 1
        robot.until("the other is ready", lambda _: followers.ready() == second)
        robot.put(keys.FOLLOW_ESTOP, STOP, stamped=False)
        robot.until("the stop holds", lambda state: state.estop)

        told = len(robot.states)
        words = ["swap", "follower", "--connect", endpoint]
        swapping = beside.submit(CliRunner().invoke, app, words)
        robot.until("the swap is done", lambda _: swapping.done())
        swapped = swapping.result()
        assert swapped.exit_code == 0, swapped.exception
        assert f"follower/{first} has handed over to follower/{second}" in swapped.output
        robot.until("the successor leads", lambda _: followers.leader() == second)
        gap_s = followers.first_s(second) - followers.last_s(first)
        assert gap_s < 0.4, "told to go on, it waits for no silence"
        robot.until("the person is known", lambda state: state.target.track_id == 1)
        robot.until("the old one is ready", lambda _: followers.ready() == first)

        processes[second].stop(signal.SIGKILL, 5.0)
        robot.until("the first leads again", lambda _: followers.leader() == first)
        robot.until("the person is known again", lambda state: state.target.track_id == 1)
        since = robot.states[told:]
        assert {state.estop for state in since} == {True}
        # None until a successor has seen the tracker's people.
        assert {state.target.track_id for state in since} <= {1, None}
        stopped = [command for _, command, _ in followers.commands[-20:]]
        assert {(one.linear_mps, one.angular_radps) for one in stopped} == {(0.0, 0.0)}

        release = STOP.model_copy(update={"engaged": False, "t_ns": 2})
        robot.put(keys.FOLLOW_ESTOP, release, stamped=False)
        driving = robot.until("driving again", lambda state: state.linear_mps > 0.3)
        assert driving.target.track_id == 1
