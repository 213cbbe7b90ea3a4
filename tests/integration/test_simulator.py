"""The simulator as a process: alone, and with the whole stack around it."""

from __future__ import annotations

import json
import math
import queue
import signal
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
import zenoh

from heel.schemas import (
    Blobs,
    CameraInfo,
    DriveState,
    EndOfStream,
    EStop,
    Header,
    Message,
    Odometry,
    Ranges,
    SimTruth,
    SimWorld,
    Stamp,
    TargetRequest,
    decode,
    encode,
    keys,
)
from heel.schemas.image import decode_image
from tests.support.network import client, collected, router, wait_until
from tests.support.processes import Running, running

BOXES = ("--perception", "simulated-boxes", "--no-pictures")
STILL_MPS = 0.03


@pytest.fixture
def endpoint() -> Iterator[str]:
    with router() as address:
        yield address


@contextmanager
def simulator(endpoint: str, *flags: str) -> Iterator[Running]:
    with running("-m", "heel.services.simulator", "--connect", endpoint, *flags) as process:
        yield process


class Newest:
    """The newest truth, and all wheel states, as they come."""

    def __init__(self, session: zenoh.Session) -> None:
        self.truth: SimTruth | None = None
        self.drive: DriveState | None = None
        self._subscribers = [
            session.declare_subscriber(keys.SIM_TRUTH, self._hear_truth),
            session.declare_subscriber(keys.ROBOT_DRIVE, self._hear_drive),
        ]

    def _hear_truth(self, sample: zenoh.Sample) -> None:
        self.truth = decode(SimTruth, sample.payload.to_bytes(), str(sample.encoding))

    def _hear_drive(self, sample: zenoh.Sample) -> None:
        self.drive = decode(DriveState, sample.payload.to_bytes(), str(sample.encoding))

    @property
    def speed_mps(self) -> float:
        return 0.0 if self.truth is None else self.truth.linear_mps

    @property
    def t_s(self) -> float:
        return 0.0 if self.truth is None else self.truth.t_s

    def gaps_m(self) -> list[float]:
        """From the robot's body to everybody's; the target is first."""
        assert self.truth is not None
        robot = self.truth.robot
        return [
            math.hypot(person.pose.x_m - robot.x_m, person.pose.y_m - robot.y_m)
            - person.radius_m - self.truth.robot_radius_m
            for person in self.truth.people
        ]  # fmt: skip


def first(samples: queue.Queue[zenoh.Sample], kind: type[Message]) -> Message:
    sample = samples.get(timeout=20.0)
    return decode(kind, sample.payload.to_bytes(), str(sample.encoding))


def latched(session: zenoh.Session, key: str, kind: type[Message]) -> Message:
    replies = [reply.ok for reply in session.get(key, timeout=5.0) if reply.ok is not None]
    assert len(replies) == 1, f"one answer on {key}"
    return decode(kind, replies[0].payload.to_bytes(), str(replies[0].encoding))


@contextmanager
def told_to_drive(session: zenoh.Session, linear_mps: float) -> Iterator[None]:
    """Speaks as a drive does, 50 times a second."""
    done = threading.Event()
    publisher = session.declare_publisher(keys.ROBOT_DRIVE)
    stamp = encode(Stamp(producer="drive/test@0123abcd", t_sent_ns=0, age_ns=0))

    def speak() -> None:
        seq = 0
        while not done.wait(0.02):
            state = DriveState(
                seq=seq, state="driving", reason="test", estop=False, driver="test",
                linear_mps=linear_mps, angular_radps=0.0,
            )  # fmt: skip
            publisher.put(encode(state), encoding=state.encoding(), attachment=stamp)
            seq += 1

    thread = threading.Thread(target=speak, daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def test_speaks_as_a_robot_does_and_ends_its_stream(endpoint: str, tmp_path: Path) -> None:
    file = tmp_path / "truth.jsonl"
    with ExitStack() as stack:
        session = stack.enter_context(client(endpoint))
        topics = {
            key: stack.enter_context(collected(session, key))
            for key in (keys.blobs("front"), keys.ROBOT_ODOMETRY, keys.ROBOT_RANGE, keys.SIM_TRUTH,
                        keys.image("front"))
        }  # fmt: skip
        process = stack.enter_context(
            simulator(endpoint, "distractor-2", "--seed", "3", *BOXES, "--truth", str(file))
        )
        blobs = first(topics[keys.blobs("front")], Blobs)
        assert isinstance(blobs, Blobs)
        assert (blobs.detector, blobs.kind) == ("simulated", "people")
        odometry = first(topics[keys.ROBOT_ODOMETRY], Odometry)
        assert isinstance(odometry, Odometry)
        assert abs(odometry.x_m) < 0.01
        ranges = first(topics[keys.ROBOT_RANGE], Ranges)
        assert isinstance(ranges, Ranges)
        assert ranges.sectors
        world = latched(session, keys.SIM_WORLD, SimWorld)
        assert isinstance(world, SimWorld)
        assert (world.scenario, world.seed) == ("distractor-2", 3)
        info = latched(session, keys.info("front"), CameraInfo)
        assert isinstance(info, CameraInfo)
        assert info.horizontal_fov_rad == pytest.approx(math.pi / 2, abs=1e-3)
        assert (info.mount_height_m, info.mount_pitch_rad) == (0.8, 0.0)
        wait_until(lambda: topics[keys.SIM_TRUTH].qsize() > 10, "truth")
        code, _ = process.stop(signal.SIGTERM, 5.0)
        assert code == 0, process.stderr()
        for key in (keys.blobs("front"), keys.image("front")):
            last = list(topics[key].queue)[-1]
            end = decode(EndOfStream, last.payload.to_bytes(), str(last.encoding))
            assert end.reason == "the simulator was stopped"
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    assert list(lines[0]) == ["sim-world"]
    assert {next(iter(line)) for line in lines[1:]} == {"sim-truth"}


def test_obeys_the_drive_and_stands_when_it_is_silent(endpoint: str) -> None:
    with client(endpoint) as session, simulator(endpoint, "straight", "--seed", "1", *BOXES):
        newest = Newest(session)
        wait_until(lambda: newest.truth is not None, "truth", 20.0)
        assert newest.speed_mps == 0.0
        with told_to_drive(session, 0.5):
            wait_until(lambda: newest.speed_mps > 0.4, "speed")
        # Nothing is said any more: no zero is sent, the simulator finds out by itself.
        since_s = newest.t_s
        wait_until(lambda: abs(newest.speed_mps) < STILL_MPS, "standstill")
        assert newest.t_s - since_s < 1.5, "in simulated time: 0.2 s of patience, then braking"


def test_pixels_come_as_from_a_camera(endpoint: str) -> None:
    pytest.importorskip("panda3d", reason="the extra sim is not installed")
    with client(endpoint) as session, ExitStack() as stack:
        images = stack.enter_context(collected(session, keys.image("front")))
        blobs = stack.enter_context(collected(session, keys.blobs("front")))
        stack.enter_context(simulator(endpoint, "pillar", "--seed", "2"))
        wait_until(lambda: images.qsize() >= 5, "pictures", 30.0)
        samples = [images.get() for _ in range(5)]
        assert blobs.empty(), "who sees is the detector, which is not there"
    headers = []
    for sample in samples:
        assert sample.attachment is not None
        header = decode(Header, sample.attachment.to_bytes())
        picture = decode_image(sample.payload.to_bytes(), header, str(sample.encoding))
        assert picture.shape == (480, 640, 3)
        assert picture.std() > 20
        headers.append(header)
    assert len({header.epoch for header in headers}) == 1
    assert [header.seq for header in headers] == sorted({header.seq for header in headers})
    assert all(header.age_ns > 0 for header in headers)


def test_the_stack_follows_at_a_distance_and_stands_on_emergency_stop(endpoint: str) -> None:
    services = (("tracker",), ("follower",), ("drive", "--driver", "simulated"))
    with ExitStack() as stack:
        session = stack.enter_context(client(endpoint))
        newest = Newest(session)
        present: set[str] = set()
        watch = session.liveliness().declare_subscriber(
            keys.ALL_ALIVE, lambda sample: present.add(str(sample.key_expr)), history=True
        )
        stack.callback(watch.undeclare)
        for name, *flags in services:
            stack.enter_context(
                running("-m", f"heel.services.{name}", "--connect", endpoint, *flags)
            )
        wait_until(lambda: len(present) == len(services), "the services", 30.0)
        process = stack.enter_context(simulator(endpoint, "distractor-2", "--seed", "5", *BOXES))
        wait_until(lambda: newest.t_s > 1.0, "the world", 30.0)
        start = newest.truth
        assert start is not None
        request = TargetRequest(mode="nearest")

        def is_chosen() -> bool:
            replies = session.get(keys.FOLLOW_TARGET, payload=encode(request),
                                  encoding=request.encoding(), timeout=2.0)  # fmt: skip
            return [reply.ok is not None for reply in replies] == [True]

        wait_until(is_chosen, "a picture that is new enough for a choice")
        least_m = math.inf

        def time_passes() -> bool:
            nonlocal least_m
            least_m = min(least_m, *newest.gaps_m())
            return newest.t_s > 16.0

        wait_until(time_passes, "15 s of following", 40.0)
        assert newest.truth is not None
        assert newest.truth.contact == 0
        assert least_m > 0.1
        assert newest.gaps_m()[0] < 4.0, "the target walks, and the robot keeps up with it"
        assert _way_m(newest.truth, start) > 4.0

        wait_until(lambda: newest.speed_mps > 0.2, "driving")
        stop = EStop(engaged=True, source="test")
        session.put(keys.FOLLOW_ESTOP, encode(stop), encoding=stop.encoding())
        since_s = newest.t_s
        wait_until(lambda: abs(newest.speed_mps) < STILL_MPS, "standstill")
        assert newest.t_s - since_s < 1.5
        wait_until(lambda: newest.drive is not None and newest.drive.estop, "the drive's word")
        assert newest.drive is not None
        assert (newest.drive.state, newest.drive.linear_mps) == ("stopped", 0.0)
        place = newest.truth
        wait_until(lambda: newest.t_s > since_s + 3.0, "a while")
        assert _way_m(newest.truth, place) < 0.3
        assert process.alive


def _way_m(one: SimTruth, other: SimTruth) -> float:
    return math.hypot(one.robot.x_m - other.robot.x_m, one.robot.y_m - other.robot.y_m)
