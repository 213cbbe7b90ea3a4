"""One tiny program per fault in the tracker's place: the robot stands, says why, and goes on.

Follower and drive are real processes. What a full disk, a full /dev/shm and a clock that jumps do
to real services is in `test_faulty_machine.py`, a loop that hangs in `test_watchdog.py`.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

import pytest
import zenoh

from heel.schemas import DriveState, FollowState, Health, TargetRequest, decode, encode, keys
from tests.support import network
from tests.support.processes import Running, running

pytestmark = pytest.mark.timeout(120)

STANDS_S = 1.0
"""From a fault to zero wheels: tracks are stale after 0.22 s, a busy machine needs the rest."""
BACK_S = 20.0


class Robot:
    """Follower and drive, and what they have told last."""

    def __init__(self, endpoint: str, resources: ExitStack) -> None:
        self.endpoint = endpoint
        self.session = resources.enter_context(network.client(endpoint))
        self.state: FollowState | None = None
        self.drive: DriveState | None = None
        self.problems = ""
        for key, hear in (
            (keys.FOLLOW_STATE, self._hear_state), (keys.ROBOT_DRIVE, self._hear_drive),
            (keys.health("follower", "main"), self._hear_health),
        ):  # fmt: skip
            resources.callback(self.session.declare_subscriber(key, hear).undeclare)
        for service in (("follower",), ("drive", "--driver", "log")):
            process = resources.enter_context(
                running("-m", f"heel.services.{service[0]}", "--connect", endpoint, *service[1:])
            )
            network.wait_until(lambda p=process: "is up" in p.stderr(), service[0], 30.0)

    def _hear_state(self, sample: zenoh.Sample) -> None:
        self.state = decode(FollowState, sample.payload.to_bytes(), str(sample.encoding))

    def _hear_drive(self, sample: zenoh.Sample) -> None:
        self.drive = decode(DriveState, sample.payload.to_bytes(), str(sample.encoding))

    def _hear_health(self, sample: zenoh.Sample) -> None:
        self.problems = decode(Health, sample.payload.to_bytes(), str(sample.encoding)).reason

    @property
    def drives(self) -> bool:
        return self.drive is not None and self.drive.linear_mps > 0.3

    @property
    def says(self) -> str:
        return "" if self.state is None else f"{self.state.state}: {self.state.reason}"

    def follow(self) -> None:
        """Choose the person who is shown, and wait until the robot drives."""
        self._ask(TargetRequest(mode="none"))

        def chosen_and_driven_after() -> bool:
            # What the follower saw last may be a tracker's of before: then it asks again.
            if self.state is None or self.state.target.mode == "none":
                self._ask(TargetRequest(mode="id", track_id=1))
            return self.drives

        network.wait_until(chosen_and_driven_after, "the robot drives", BACK_S)

    def _ask(self, request: TargetRequest) -> bool:
        replies = self.session.get(keys.FOLLOW_TARGET, payload=encode(request), timeout=5.0)
        return any(reply.ok is not None for reply in replies)

    @property
    def asks(self) -> bool:
        return self.state is not None and "choose again" in self.state.target.reason

    def drives_for(self, seconds: float) -> bool:
        """Whether the wheels turn all the time."""
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            if not self.drives:
                return False
            time.sleep(0.01)
        return True


@pytest.fixture(scope="module")
def robot() -> Iterator[Robot]:
    with ExitStack() as resources:
        yield Robot(resources.enter_context(network.router()), resources)


@contextmanager
def tracker(robot: Robot, fault: str, start: str) -> Iterator[Running]:
    with running("-m", "tests.integration.odd_tracker", robot.endpoint, fault, start) as process:
        network.wait_until(lambda: "up" in process.stdout(), f"a tracker that is {fault}", 30.0)
        yield process


def go_on(process: Running) -> None:
    process.process.send_signal(signal.SIGUSR2)
    process.process.send_signal(signal.SIGCONT)


@pytest.mark.parametrize(
    ("fault", "start"),
    [("silent", "0000000a"), ("slow", "0000000b"), ("late", "0000000c"), ("frozen", "0000000d")],
)
def test_the_robot_stands_says_why_and_goes_on_with_the_same_person(
    robot: Robot, fault: str, start: str
) -> None:
    with tracker(robot, fault, start) as process:
        robot.follow()
        process.process.send_signal(signal.SIGUSR1)
        network.wait_until(lambda: not robot.drives, "the wheels stand", STANDS_S)
        network.wait_until(lambda: "lost: tracks are older than" in robot.says, "why")
        go_on(process)
        network.wait_until(lambda: robot.drives, "the robot goes on by itself", BACK_S)
        assert robot.state is not None
        assert robot.state.target.track_id == 1


def test_after_a_crash_another_tracker_s_person_of_the_same_id_is_not_followed_unasked(
    robot: Robot,
) -> None:
    with tracker(robot, "crashing", "0000000e") as process:
        robot.follow()
        process.process.send_signal(signal.SIGUSR1)
        assert process.wait(10.0) == 1
        network.wait_until(lambda: not robot.drives, "the wheels stand", STANDS_S)
    with tracker(robot, "none", "0000000f"):
        network.wait_until(lambda: robot.asks, "whom to follow is asked", BACK_S)
        assert not robot.drives
        robot.follow()


def test_of_two_trackers_the_first_is_followed_and_the_second_is_named(robot: Robot) -> None:
    with tracker(robot, "none", "00000010"):
        robot.follow()
        with tracker(robot, "none", "00000011"):
            named: Callable[[], bool] = lambda: "two producers" in robot.problems  # noqa: E731
            network.wait_until(named, "the second is named")
            assert robot.drives_for(0.5)


def test_a_clock_that_jumps_stops_nobody(robot: Robot) -> None:
    with tracker(robot, "clock jump", "00000012") as process:
        robot.follow()
        process.process.send_signal(signal.SIGUSR1)
        assert robot.drives_for(1.0)
