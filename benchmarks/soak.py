"""Half an hour of the whole robot: is memory flat, and is every frame accounted for?

Router, detector, tracker, follower, drive and page run as real processes on a free loopback port;
the camera starts last and ends first, so that what it sent and what each stage had of it can be
compared to the frame: `received` and `dropped` (gaps in the numbers) have to be all of them, but
for the first ones, which a camera sends before it knows of its listeners.

Example run: python -m benchmarks.soak --minutes 30 --write docs/records/soak.md
"""

from __future__ import annotations

import functools
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import typer
import zenoh

from benchmarks.common import NAMED_NETWORKS, REPOSITORY, Write, publish, wait_for
from heel.schemas import Health, HeelError, MessageError, decode, keys
from heel.services.runtime.command_line import run_app
from heel.services.runtime.process import memory_mb
from heel.services.runtime.session import zenoh_config
from heel.services.runtime.settings import ZenohSettings

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
SOURCE = "scene:demo?width=640&height=480"
STAGES = ("detector", "tracker", "follower")
MOST_GROWTH = 0.02
FIRST_FRAMES = 25
"""A camera hears within a second who listens."""
_UP_S = 180.0
_LOOK_S = 1.0
_DRAIN_S = 3.0
_WARM_SHARE = 0.25
"""Of the time, until galleries, rings and glibc's arenas have been filled once."""
_EDGE_SHARE = 0.1
"""Of the time, over which memory is taken the median of, at the beginning and at the end."""


@dataclass
class Robot:
    """The processes, and what they say of themselves."""

    port: int
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)
    health: dict[str, Health] = field(default_factory=dict)

    def start(self, folder: Path, service: str, *words: str) -> None:
        """Start one of them."""
        where = "--listen" if service == "router" else "--connect"
        with (folder / f"{service}.log").open("wb") as log:
            self.processes[service] = subprocess.Popen(
                [sys.executable, "-P", "-m", "heel", service, *words, where, self.endpoint],
                cwd=REPOSITORY, env=os.environ | NAMED_NETWORKS, stdin=subprocess.DEVNULL,
                stdout=log, stderr=log, start_new_session=True,
            )  # fmt: skip

    @property
    def endpoint(self) -> str:
        """Of the router."""
        return f"tcp/127.0.0.1:{self.port}"

    def hear(self, sample: zenoh.Sample) -> None:
        """Keep the newest health of each service."""
        try:
            health = decode(Health, sample.payload.to_bytes(), str(sample.encoding))
        except MessageError:
            return
        self.health[health.service] = health

    def end(self) -> None:
        """End all of them."""
        for process in self.processes.values():
            process.terminate()
        for process in self.processes.values():
            process.wait(_UP_S)


@dataclass(frozen=True)
class Stage:
    """What one service had of the camera's frames."""

    name: str
    received: int
    dropped: int
    malformed: int
    unaccounted: int


@dataclass(frozen=True)
class Outcome:
    """What became of the robot."""

    minutes: float
    frames: int
    """That the camera sent."""
    skipped: int
    """That it was too late for."""
    stages: tuple[Stage, ...]
    memory_mb: dict[str, tuple[float, float]]
    """Of each process, once warm and at the end."""

    @property
    def growth(self) -> float:
        """Of all together, as a share."""
        warm, end = (sum(both[k] for both in self.memory_mb.values()) for k in (0, 1))
        return end / warm - 1.0

    def faults(self) -> list[str]:
        """What must not have happened and did."""
        found = [f"{one.name}: {one.unaccounted} frames unaccounted for" for one in self.stages
                 if not 0 <= one.unaccounted <= FIRST_FRAMES]  # fmt: skip
        found += [f"{one.name}: {one.malformed} malformed" for one in self.stages if one.malformed]
        if self.growth > MOST_GROWTH:
            found.append(f"memory grew by {self.growth:.1%}")
        return found


def soak(minutes: float, source: str = SOURCE) -> Outcome:
    """Run the robot for so long.

    Raises:
        HeelError: a process does not start, or ends by itself.
    """
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="heel-soak-")))
        robot = Robot(_free_port())
        stack.callback(robot.end)
        robot.start(folder, "router")
        wait_for(lambda: "listens" in (folder / "router.log").read_text(), _UP_S, "no router")
        session = stack.enter_context(
            zenoh.open(zenoh_config(ZenohSettings(connect=(robot.endpoint,))))
        )
        session.declare_subscriber(keys.ALL_HEALTH, robot.hear)
        for service in (*STAGES, "drive"):
            robot.start(folder, service)
        robot.start(folder, "web", "--port", "0")
        for service in (*STAGES, "drive", "web"):
            log = folder / f"{service}.log"
            look = functools.partial(_is_up, log)
            wait_for(look, _UP_S, f"{service} is not up: {log.read_text()}")
        robot.start(folder, "capture", source, "--loop")
        memory = _watch(robot, 60.0 * minutes)
        return _account(robot, minutes, memory)


def _is_up(log: Path) -> bool:
    return " is up" in log.read_text()


def _watch(robot: Robot, seconds: float) -> dict[str, tuple[float, float]]:
    """Memory of each process once warm and at the end, MB."""
    started_s = time.monotonic()
    seen: dict[str, list[tuple[float, float]]] = {name: [] for name in robot.processes}
    while (share := (time.monotonic() - started_s) / seconds) < 1.0:
        time.sleep(_LOOK_S)
        for name, process in robot.processes.items():
            if process.poll() is not None:
                raise HeelError(f"{name} ended with code {process.returncode}")
            seen[name].append((share, memory_mb(process.pid)[0]))
    return {
        name: (
            statistics.median(mb for share, mb in some
                              if _WARM_SHARE <= share < _WARM_SHARE + _EDGE_SHARE),
            statistics.median(mb for share, mb in some if share >= 1.0 - _EDGE_SHARE),
        )
        for name, some in seen.items()
    }  # fmt: skip


def _account(robot: Robot, minutes: float, memory: dict[str, tuple[float, float]]) -> Outcome:
    robot.processes["capture"].terminate()
    robot.processes["capture"].wait(_UP_S)
    time.sleep(_DRAIN_S)
    frames = robot.health["capture"].sent
    stages = tuple(
        Stage(name, one.received, one.dropped, one.malformed, frames - one.received - one.dropped)
        for name, one in ((name, robot.health[name]) for name in STAGES)
    )
    return Outcome(minutes, frames, robot.health["capture"].dropped, stages, memory)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def table_of(outcome: Outcome) -> str:
    """Markdown: frames by stage, memory by process."""
    lines = [
        f"{outcome.minutes:g} minutes, {outcome.frames} frames sent, {outcome.skipped} skipped by "
        "the camera.", "",
        "| stage | received | dropped | malformed | before it was heard |", "|---|---|---|---|---|",
        *(f"| {one.name} | {one.received} | {one.dropped} | {one.malformed} | {one.unaccounted} |"
          for one in outcome.stages), "",
        "| process | warm, MB | at the end, MB | growth, % |", "|---|---|---|---|",
        *(f"| {name} | {warm:.1f} | {end:.1f} | {100.0 * (end / warm - 1.0):+.1f} |"
          for name, (warm, end) in outcome.memory_mb.items()),
        f"| all | {sum(a for a, _ in outcome.memory_mb.values()):.1f} | "
        f"{sum(b for _, b in outcome.memory_mb.values()):.1f} | {100.0 * outcome.growth:+.1f} |",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


@app.command()
def main(
    minutes: Annotated[float, typer.Option(help="how long", min=0.1)] = 30.0,
    source: Annotated[str, typer.Option(help="what the camera sees")] = SOURCE,
    write: Write = None,
) -> None:
    """Print what became of every frame and of memory; exit code 1 for a fault."""
    outcome = soak(minutes, source)
    publish(table_of(outcome), write, "soak")
    if faults := outcome.faults():
        raise HeelError("; ".join(faults))


if __name__ == "__main__":
    run_app(app)
