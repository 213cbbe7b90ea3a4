"""A robot of ROS in the simulated world, the bridge, and all of Heel's services, each a process."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import sys
import threading
import time
from bisect import bisect_left
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Self

from benchmarks.common import NAMED_NETWORKS, REPOSITORY, wait_for
from benchmarks.ros.world import CAMERA
from heel.schemas import (
    EndOfStream,
    FollowState,
    HeelError,
    SimTruth,
    TargetRequest,
    Tracks,
    decode,
    encode,
    keys,
)
from heel.services.run.onlooker import Onlooker, Recorder
from heel.services.runtime import qos
from heel.services.runtime.inbox import Inbox
from heel.services.runtime.process import PARENT_VARIABLE
from heel.services.runtime.router import open_private_router
from heel.services.simulator.wheels import TIMEOUT_S

CHAIN = ("ros2", "detector", "tracker", "follower", "drive")
"""What is ours between the robot's camera and its wheels."""
_START_S = 60.0
_END_S = 3.0
_SILENCE_S = 20.0
"""Longest time without a picture's truth [s]: the robot's process hangs. Chosen by hand."""
_NEAR_NS = 20_000_000
"""Tracks are of the moment whose stamp is at most so far from their own [ns]: moments are 33 ms
apart, pictures 67 ms, and a picture has its moment's very stamp."""
_ANSWER_S = 1.0


@dataclass(frozen=True)
class Choices:
    """How the loop is set up.

    Attributes:
        rmw: dds or zenoh.
        python: of an environment with ROS, for the robot, and for the bridge by DDS.
        model: network of the detector; none for none.
    """

    rmw: str
    python: str
    model: str = "none"


@dataclass
class Told:
    """What the robot's process told.

    Attributes:
        velocities: monotonic time, m/s and rad/s of every one that it heard.
    """

    velocities: list[tuple[float, float, float]] = field(default_factory=list)
    truths: queue.SimpleQueue[tuple[int, SimTruth] | None] = field(
        default_factory=queue.SimpleQueue
    )


class Stack:
    """Everything that runs for one episode; use as a context manager.

    Args:
        folder: for logs.
        choices: how.
        scenario, seed: which episode.
    """

    def __init__(self, folder: Path, choices: Choices, scenario: str, seed: int) -> None:
        self._folder, self._choices = folder, choices
        self._scenario, self._seed = scenario, seed
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.told = Told()
        self._kept = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            stack.callback(self._end_all)
            self.session, self._endpoint = stack.enter_context(open_private_router())
            self.inbox = stack.enter_context(Inbox(self.session))
            self.inbox.subscribe(
                "tracks", keys.tracks("front"), qos.TRACKS.for_delivery("lossless")
            )
            self.inbox.subscribe("state", keys.FOLLOW_STATE, qos.STATE.for_delivery("lossless"))
            ros = stack.enter_context(open_private_router())[1]
            for name in CHAIN:
                self._start(name, *self._flags(name, ros))
            present: set[str] = set()
            tokens = self.session.liveliness().declare_subscriber(
                keys.ALL_ALIVE, lambda one: present.add(str(one.key_expr).split("/")[1]),
                history=True,
            )  # fmt: skip
            wait_for(lambda: present >= set(CHAIN), _START_S, f"only {present} up")
            tokens.undeclare()  # type: ignore[no-untyped-call]
            self._start_robot(ros)
            self._kept = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._kept.close()

    def moments(self) -> Iterator[tuple[int, SimTruth]]:
        """Stamp and truth of every moment that is told, until the episode is over.

        Raises:
            HeelError: the robot's process failed.
        """
        while True:
            try:
                told = self.told.truths.get(timeout=_SILENCE_S)
            except queue.Empty:
                raise HeelError(f"the robot is silent: {self.last_words('robot')}") from None
            if told is None:
                break
            yield told
        if self.processes["robot"].wait(_END_S):
            raise HeelError(f"the robot failed: {self.last_words('robot')}")

    def play(self, recorder: Recorder, until: Callable[[SimTruth], bool] | None = None) -> None:
        """Look on and click as a user does, until the episode is over or something holds.

        Raises:
            HeelError: a process ended.
        """
        onlooker = Onlooker(recorder, self._click)
        recorder.episode()
        stamps: list[int] = []
        for stamp_ns, truth in self.moments():
            stamps.append(stamp_ns)
            arrivals = list(self.inbox.all_of(0.0))
            # States first: without one the first moment would not be recorded, and an episode
            # without all of its moments counts as cut off.
            for arrival in arrivals:
                if arrival.topic == "state":
                    onlooker.state(decode(FollowState, arrival.payload, arrival.encoding))
            onlooker.truth(truth)
            for arrival in arrivals:
                if arrival.topic == "tracks" and arrival.encoding != EndOfStream.encoding():
                    tracks = decode(Tracks, arrival.payload, arrival.encoding)
                    seq = _seq_of(stamps, tracks.t_capture_ns)
                    if seq is not None:
                        onlooker.tracks(tracks.model_copy(update={"seq": seq}))
            if gone := [name for name, one in self.processes.items() if one.poll()]:
                raise HeelError(f"{gone[0]} ended: {self.last_words(gone[0])}")
            if until is not None and until(truth):
                return

    def kill(self, name: str) -> float:
        """SIGKILL one process; when that was, monotonic seconds."""
        now_s = time.monotonic()
        self.processes[name].send_signal(signal.SIGKILL)
        return now_s

    def last_words(self, name: str) -> str:
        """End of a process's log."""
        return (self._folder / f"{name}.log").read_text("utf-8", "replace")[-500:].strip()

    def _flags(self, name: str, ros: str) -> tuple[str, ...]:
        flags: dict[str, tuple[str, ...]] = {
            "ros2": ("--rmw", self._choices.rmw, "--ros-router", ros, "--fps", f"{CAMERA.fps:g}",
                     "--mount-height-m", f"{CAMERA.mount_height_m:g}",
                     "--mount-pitch-deg", f"{CAMERA.mount_pitch_deg:g}"),
            "detector": () if self._choices.model == "none" else ("--model", self._choices.model),
            "drive": ("--driver", "log"),
        }  # fmt: skip
        return ("-m", f"heel.services.{name}", "--connect", self._endpoint, *flags.get(name, ()))

    def _start(self, name: str, *words: str, output: int | None = None) -> subprocess.Popen[bytes]:
        ros = name == "robot" or (name == "ros2" and self._choices.rmw == "dds")
        with (self._folder / f"{name}.log").open("wb") as log:
            process = subprocess.Popen(
                [self._choices.python if ros else sys.executable, *words], cwd=REPOSITORY,
                stdin=subprocess.DEVNULL, stdout=log if output is None else output, stderr=log,
                env={**os.environ, **NAMED_NETWORKS, PARENT_VARIABLE: str(os.getpid()),
                     "ROS_DOMAIN_ID": str(1 + os.getpid() % 99),
                     "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
            )  # fmt: skip
        self.processes[name] = process
        return process

    def _start_robot(self, ros: str) -> None:
        robot = self._start(
            "robot", "-m", "benchmarks.ros.world", self._scenario, "--seed", str(self._seed),
            "--rmw", self._choices.rmw, "--router", ros, output=subprocess.PIPE,
        )  # fmt: skip
        assert robot.stdout is not None
        threading.Thread(target=self._read, args=(robot.stdout,), daemon=True).start()

    def _read(self, output: IO[bytes]) -> None:
        for line in output:
            kind, _, rest = line.decode().partition(" ")
            if kind == "V":
                heard_s, linear_mps, angular_radps = map(float, rest.split())
                self.told.velocities.append((heard_s, linear_mps, angular_radps))
            elif kind == "T":
                stamp_ns, _, truth = rest.partition(" ")
                self.told.truths.put((int(stamp_ns), SimTruth.model_validate_json(truth)))
        self.told.truths.put(None)

    def _click(self, request: TargetRequest) -> None:
        self.session.get(
            keys.FOLLOW_TARGET, lambda _: None, timeout=_ANSWER_S, payload=encode(request),
            encoding=request.encoding(),
        )  # fmt: skip

    def _end_all(self) -> None:
        for process in reversed(self.processes.values()):
            with suppress(ProcessLookupError):
                process.terminate()
        for process in self.processes.values():
            try:
                process.wait(_END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait(_END_S)


def _seq_of(stamps: list[int], t_ns: int) -> int | None:
    """Number of the picture that was taken then; None: none was."""
    at = bisect_left(stamps, t_ns)
    near = [index for index in (at - 1, at) if 0 <= index < len(stamps)]
    best = min(near, key=lambda index: abs(stamps[index] - t_ns), default=None)
    return best if best is not None and abs(stamps[best] - t_ns) <= _NEAR_NS else None


def stands_after(velocities: list[tuple[float, float, float]], since_s: float) -> float:
    """Seconds from a moment to when the base stands for good; 0 where it stood before.

    It does when it hears zero, or when it has heard nothing for as long as bases wait.

    Args:
        velocities: monotonic time, m/s and rad/s of each that it heard.
        since_s: the moment, by the same clock.
    """
    moving = [at for at, (_, linear, angular) in enumerate(velocities) if linear or angular]
    if not moving:
        return 0.0
    stands_s = velocities[moving[-1]][0] + TIMEOUT_S
    if moving[-1] + 1 < len(velocities):
        stands_s = min(stands_s, velocities[moving[-1] + 1][0])
    return max(0.0, stands_s - since_s)
