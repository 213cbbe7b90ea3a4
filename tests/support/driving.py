"""A drive process, and a client that commands it and watches what its wheels are told."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import zenoh

from heel.schemas import DriveState, Health, MotionCommand, Stamp, decode, encode, keys
from tests.support.network import wait_until
from tests.support.processes import Running, running

FOLLOWER, OTHER = "follower/main@00000001", "follower/other@00000002"


def stamp(producer: str = FOLLOWER) -> bytes:
    return encode(Stamp(producer=producer, t_sent_ns=0, age_ns=0))


def motion(seq: int, linear_mps: float = 0.5, angular_radps: float = 0.1) -> MotionCommand:
    return MotionCommand(
        seq=seq, linear_mps=linear_mps, angular_radps=angular_radps, ttl_s=0.5,
        state="following", reason="target in sight",
    )  # fmt: skip


class Robot:
    """One drive process as its network sees it."""

    def __init__(self, session: zenoh.Session, process: Running) -> None:
        self.process = process
        self.newest: DriveState | None = None
        self.health: Health | None = None
        self._session = session
        self._subscribers = [
            session.declare_subscriber(keys.ROBOT_DRIVE, self._note_state),
            session.declare_subscriber(keys.health("drive", "main"), self._note_health),
        ]

    def close(self) -> None:
        for subscriber in self._subscribers:
            subscriber.undeclare()

    def is_up(self) -> bool:
        return "is up" in self.process.stderr()

    def drives(self) -> bool:
        return self.newest is not None and self.newest.linear_mps > 0.0

    @property
    def stopped(self) -> bool:
        """Whether the emergency stop holds."""
        return self.newest is not None and self.newest.estop

    def stands_because(self, reason: str) -> bool:
        newest = self.newest
        if newest is None or reason not in newest.reason:
            return False
        return (newest.state, newest.linear_mps, newest.angular_radps) == ("stopped", 0.0, 0.0)

    def refused(self) -> int:
        return 0 if self.health is None else self.health.malformed

    def complaints(self, level: str) -> list[str]:
        lines = map(json.loads, self.process.stderr().splitlines())
        return [line["message"] for line in lines if line["level"] == level]

    @contextmanager
    def commanded(
        self, producer: str = FOLLOWER, first_seq: int = 0, linear_mps: float = 0.5
    ) -> Iterator[None]:
        """Commands at 50 Hz for as long as the block lasts."""
        ending = threading.Event()

        def send() -> None:
            seq = first_seq
            while not ending.wait(0.02):
                command = motion(seq, linear_mps)
                self._session.put(
                    keys.FOLLOW_COMMAND, encode(command), encoding=command.encoding(),
                    attachment=stamp(producer),
                )  # fmt: skip
                seq += 1

        thread = threading.Thread(target=send, daemon=True)
        thread.start()
        try:
            yield
        finally:
            ending.set()
            thread.join(5.0)

    def _note_state(self, sample: zenoh.Sample) -> None:
        self.newest = decode(DriveState, sample.payload.to_bytes(), str(sample.encoding))

    def _note_health(self, sample: zenoh.Sample) -> None:
        self.health = decode(Health, sample.payload.to_bytes(), str(sample.encoding))


@contextmanager
def drive_process(
    endpoint: str, session: zenoh.Session, *flags: str, **environment: str
) -> Iterator[Robot]:
    """`python -m heel.services.drive` that is up."""
    with running(
        "-m", "heel.services.drive", "--connect", endpoint, *flags, **environment
    ) as process:
        robot = Robot(session, process)
        try:
            wait_until(lambda: robot.is_up() or not process.alive, "the drive", 30.0)
            yield robot
        finally:
            robot.close()


def next_seq() -> int:
    """Greater than every one asked for before."""
    return time.monotonic_ns()
