"""Containers are frozen, cut off, killed and exchanged while the robot follows somebody.

The robot is a simulated one, which sees the simulator's own boxes: what is tried is what becomes of
the others. Seen through the page, as a user sees it.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.docker.engine import IMAGE, REPOSITORY, Project
from tests.support.network import wait_until

pytestmark = [pytest.mark.docker, pytest.mark.timeout(240)]

START_S = 60.0
STANDS_S = 1.5
"""From a fault to a stand: tracks are stale after 0.22 s, commands after 0.5 s, and it brakes."""
BACK_S = 30.0
"""A container that was killed starts within a few seconds; a busy machine needs the rest."""
STEADY_S = 1.0
STANDING_MPS = 1e-3
"""Simulated wheels come ever nearer to zero; chosen by hand."""
WORLD = """
services:
  world:
    command: [simulator, straight, --seed, "1", --loop, --perception, simulated-boxes,
              --no-pictures, --health-file, /tmp/health]
"""


@dataclass(frozen=True)
class Moment:
    """What the page told once."""

    at_s: float
    state: str
    target: int | None
    asks: bool
    linear_mps: float


class Robot:
    """The containers of the profile `demo`, and what their page has told since."""

    def __init__(self, project: Project) -> None:
        self.project = project
        self.moments: list[Moment] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._over.set()
        self._thread.join()

    def _look(self) -> None:
        while not self._over.wait(0.05):
            with suppress(urllib.error.URLError, OSError, ValueError, KeyError, TypeError):
                told = json.loads(self.project.page("/api/state"))
                follower, drive = told["follower"], told["drive"]
                self.moments.append(Moment(
                    time.monotonic(), follower["state"], follower["target"]["track_id"],
                    "choose again" in follower["target"]["reason"],
                    drive["linear_mps"] if drive["age_s"] < 1.0 else 0.0,
                ))  # fmt: skip

    def since(self, at_s: float) -> list[Moment]:
        return [one for one in self.moments if one.at_s >= at_s]

    def post(self, path: str, **body: object) -> None:
        address = f"http://127.0.0.1:{self.project.port}"
        asked = urllib.request.Request(
            address + path,
            json.dumps(body).encode(),
            {"Content-Type": "application/json", "Origin": address},
        )
        with suppress(urllib.error.URLError, OSError):
            urllib.request.urlopen(asked, timeout=5).close()

    def follows(self) -> bool:
        """Whether it has followed and driven for a while."""
        seen = self.since(time.monotonic() - STEADY_S)
        return len(seen) >= 5 and all(
            one.state == "following" and one.linear_mps > 0.1 for one in seen
        )  # fmt: skip

    def begin(self) -> int:
        """A world from its beginning, in which the robot follows; whom."""
        self.project.compose("restart", "-t", "1", "world")

        def chosen() -> bool:
            if self.moments and self.moments[-1].state != "following":
                self.post("/api/target", mode="nearest")
            return self.follows()

        wait_until(chosen, "a robot that follows", START_S)
        target = self.moments[-1].target
        assert target is not None
        return target

    def stands_soon(self, at_s: float) -> None:
        """A fault at that time has to bring the robot to a stand, and keep it there."""
        wait_until(lambda: time.monotonic() > at_s + STANDS_S + 1.0, "time to pass")
        late = self.since(at_s + STANDS_S)
        assert len(late) >= 3, "the page answers"
        assert {one.linear_mps for one in late} == {0.0}

    def goes_on(self, target: int, from_s: float) -> None:
        """It follows the same person by itself, or asks."""
        wait_until(
            lambda: any(one.asks for one in self.since(from_s)) or self.follows(),
            "to follow again, or to ask", BACK_S,
        )  # fmt: skip
        seen = self.since(from_s)
        followed = {one.target for one in seen if one.linear_mps > 0.0}
        assert followed <= {target}, "nobody else is followed unasked"
        how = "asks" if any(one.asks for one in seen) else "follows"
        print(f"{how} {time.monotonic() - from_s:.1f} s later")


@pytest.fixture(scope="module")
def robot(image: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    folder = tmp_path_factory.mktemp("world")
    (folder / "world.yml").write_text(WORLD, encoding="utf-8")
    project = Project(
        folder, COMPOSE_FILE=f"docker-compose.yml:{folder / 'world.yml'}", COMPOSE_PROFILES="demo",
        HEEL_DEMO_IMAGE=IMAGE,
    )  # fmt: skip
    project.up()
    made = Robot(project)
    try:
        yield made
    finally:
        made.close()
        project.down()


@contextmanager
def frozen(robot: Robot, service: str) -> Iterator[None]:
    robot.project.compose("pause", service)
    try:
        yield
    finally:
        robot.project.compose("unpause", service)


@contextmanager
def cut_off(robot: Robot, service: str) -> Iterator[None]:
    network, container = f"{robot.project.name}_bus", robot.project.container(service)
    robot.project.run("docker", "network", "disconnect", network, container)
    try:
        yield
    finally:
        robot.project.run("docker", "network", "connect", "--alias", service, network, container)


@contextmanager
def killed(robot: Robot, service: str) -> Iterator[None]:
    if os.geteuid() != 0:
        pytest.skip("ending a container's process takes root")
    # `docker kill` would be an order to stop, which no restart policy undoes.
    os.kill(robot.project.inspect(service)["State"]["Pid"], signal.SIGKILL)
    yield


@pytest.mark.parametrize(
    ("service", "fault"),
    [
        ("tracker", frozen),
        pytest.param("tracker", cut_off, marks=pytest.mark.slow),
        pytest.param("follower", frozen, marks=pytest.mark.slow),
        pytest.param("follower", cut_off, marks=pytest.mark.slow),
        pytest.param("follower", killed, marks=pytest.mark.slow),
        pytest.param("tracker", killed, marks=pytest.mark.slow),
    ],
)
def test_the_robot_stands_and_goes_on_with_the_same_person_or_asks(
    robot: Robot, service: str, fault: Callable[[Robot, str], AbstractContextManager[None]]
) -> None:
    target = robot.begin()
    with fault(robot, service):
        if fault is not killed:
            robot.stands_soon(time.monotonic())
        from_s = time.monotonic()
    robot.goes_on(target, from_s)


class Wheels:
    """What the drive said, and how fast the simulated robot truly was: its wheels stand 0.2 s after
    the drive's last word, as a board's own watchdog has to make them."""

    def __init__(self, robot: Robot, out: Path) -> None:
        self._out = out
        script = Path(__file__).with_name("wheels.py").read_text(encoding="utf-8")
        command = ["docker", "compose", "exec", "-T", "web", "python3", "-", "400"]
        with out.open("wb") as file:
            self._process = subprocess.Popen(
                command, cwd=REPOSITORY, env=robot.project.environment, stdin=subprocess.PIPE,
                stdout=file,
            )  # fmt: skip
        assert self._process.stdin is not None
        self._process.stdin.write(script.encode())
        self._process.stdin.close()

    def close(self) -> None:
        self._process.kill()
        self._process.wait()

    def _lines(self, kind: str) -> list[list[str]]:
        text = self._out.read_text(encoding="utf-8")
        whole = text[: text.rfind("\n") + 1].splitlines()
        return [line.split()[1:] for line in whole if line.startswith(kind)]

    def truth(self, from_s: float, to_s: float = math.inf) -> list[float]:
        """True speeds within a time [m/s]."""
        return [float(v) for t, v in self._lines("truth") if from_s <= float(t) < to_s]

    def new_drive(self, old: str) -> list[tuple[float, bool, float]]:
        """Time, stop and speed of each word of a drive that is not the old one."""
        return [
            (float(t), stopped == "1", float(v))
            for t, producer, stopped, v in self._lines("drive")
            if producer != old
        ]

    @property
    def producer(self) -> str:
        """The drive that spoke last."""
        return self._lines("drive")[-1][1]


@pytest.fixture
def wheels(robot: Robot, tmp_path: Path) -> Iterator[Wheels]:
    wheels = Wheels(robot, tmp_path / "wheels")
    try:
        wait_until(lambda: bool(wheels.truth(0.0)), "the simulated robot", 2 * START_S)
        yield wheels
    finally:
        wheels.close()


@pytest.mark.slow
@pytest.mark.timeout(480)
@pytest.mark.parametrize("stopped", [False, True], ids=["following", "emergency stop"])
def test_a_drive_that_is_killed_while_the_robot_drives_comes_back_from_zero(
    robot: Robot, wheels: Wheels, stopped: bool
) -> None:
    target = robot.begin()
    assert max(wheels.truth(time.monotonic() - STEADY_S)) > 0.1
    old = wheels.producer
    if stopped:
        # Pressed while it drives, and the drive dies before it has braked.
        robot.post("/api/stop")
    with killed(robot, "world-drive"):
        from_s = time.monotonic()
    try:
        wait_until(lambda: len(wheels.new_drive(old)) > 20, "a new drive", BACK_S)
        words = wheels.new_drive(old)
        back_s = words[0][0]
        print(f"back {back_s - from_s:.1f} s later")
        assert words[0][2] == 0.0, "it begins from zero"
        speeds = wheels.truth(from_s + STANDS_S, back_s)
        assert max(speeds, default=0.0) < STANDING_MPS, "the wheels stand until then"
        if not stopped:
            robot.goes_on(target, back_s)
            assert max(wheels.truth(back_s)) > 0.1
            return
        assert {one[1:] for one in words} == {(True, 0.0)}, "it kept the stop"
        wait_until(lambda: time.monotonic() > back_s + 3.0, "time to pass")
        assert max(wheels.truth(back_s + STANDS_S)) < STANDING_MPS
    finally:
        if stopped:
            robot.post("/api/resume")
    wait_until(robot.follows, "to follow once it is released", BACK_S)


def test_a_tracker_is_exchanged_and_the_robot_follows_the_same_person_unasked(robot: Robot) -> None:
    second = f"{robot.project.name}-second"
    robot.project.compose(
        "run", "-d", "--name", second, "tracker", "tracker", "--standby", "--instance", "second"
    )
    try:
        target = robot.begin()
        from_s = time.monotonic()

        def handed_over() -> bool:
            try:
                robot.project.compose("exec", "-T", "web", "heel", "swap", "tracker")
            except AssertionError:
                return False
            return True

        wait_until(handed_over, "a second tracker in step", START_S)
        robot.project.compose("stop", "tracker")
        stopped_s = time.monotonic()
        wait_until(
            lambda: time.monotonic() > stopped_s + STEADY_S and robot.follows(), "to follow", BACK_S
        )
        seen = robot.since(from_s)
        # Whether it stood for a moment is the machine's: how long is measured in benchmarks.swaps.
        assert {(one.target, one.asks) for one in seen} == {(target, False)}
    finally:
        robot.project.run("docker", "rm", "-f", second)
        robot.project.compose("start", "tracker")


def test_an_emergency_stop_outlives_all_containers_at_once(robot: Robot) -> None:
    def stopped() -> list[bool]:
        told = json.loads(robot.project.page("/api/state"))
        return [told["drive"]["estop"], told["follower"]["estop"]]

    def heard(answer: bool) -> bool:
        with suppress(urllib.error.URLError, OSError, ValueError, KeyError, TypeError):
            return stopped() == [answer, answer]
        return False

    wait_until(lambda: heard(False), "drive and follower", START_S)
    robot.post("/api/stop")
    wait_until(lambda: heard(True), "the stop", BACK_S)
    robot.project.compose("stop", "-t", "5")
    robot.project.compose("start")
    try:
        wait_until(lambda: heard(True), "the stop of before", START_S)
    finally:
        robot.post("/api/resume")
    wait_until(lambda: heard(False), "the release", BACK_S)
