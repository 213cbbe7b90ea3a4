"""What a further camera costs, and a further robot: processor, memory, bandwidth.

A camera is capture, detector and tracker; a robot is a camera, follower and drive under a name of
its own. All are on one router, as real processes, each at a rate at which the machine keeps up.
Processor time is told per frame, so that what else the machine does counts little; memory is the
proportional share (PSS) that the kernel tells, where common pages count once.

Example run: python -m benchmarks.scale --write docs/records/scale.md
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer
import zenoh

from benchmarks.common import Write, publish, wait_for
from heel.schemas import Health, decode
from heel.schemas.image import encode_image
from heel.services.capture.sources import open_source
from heel.services.runtime.command_line import run_app
from heel.services.runtime.process import PARENT_VARIABLE
from heel.services.runtime.router import open_private_router

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
Kind = Literal["cameras", "robots"]
SCENE = "scene:demo"
PER_CAMERA = ("capture", "detector", "tracker")
PER_ROBOT = (*PER_CAMERA, "follower", "drive")
_START_S = 300.0
"""Longest start of all processes, on a busy machine; chosen by hand."""
_STEADY = 20
"""Frames of each camera before the measurement begins: the background is learned; chosen by
hand."""
_SIZES_S = 6.0
"""How long the sizes of messages are looked at, people coming and going; chosen by hand."""
_TICKS_HZ = os.sysconf("SC_CLK_TCK")
LINKS_MBIT = {"good Wi-Fi": 100.0, "1 Gbit/s": 940.0}
"""What a link carries of data; chosen by hand."""
FPS_ROBOT = 25.0
"""Of a robot's camera, for what is told of more machines than one."""


@dataclass(frozen=True)
class Cost:
    """Means per camera or robot.

    Attributes:
        count: of cameras or robots.
        fps: frames per second that the last service of each had.
        cpu_ms: processor time per frame, by service; the router's share as `router`.
        memory_mb: proportional set size, without the router.
        router_mb: of the router.
        dropped: share of frames that were dropped.
        bytes_frame: bytes per frame of image, blobs and tracks; empty: not looked at.
    """

    count: int
    fps: float
    cpu_ms: dict[str, float]
    memory_mb: float
    router_mb: float
    dropped: float
    bytes_frame: dict[str, float]

    @property
    def total_ms(self) -> float:
        """Processor time per frame."""
        return sum(self.cpu_ms.values())


class Listener:
    """Keeps the newest health of every process, and the sizes of a camera's messages."""

    def __init__(self, session: zenoh.Session, resources: ExitStack) -> None:
        self.health: dict[tuple[str, str], Health] = {}
        for key in ("svc/*/*/health", "*/svc/*/*/health"):
            resources.callback(session.declare_subscriber(key, self._hear).undeclare)

    def _hear(self, sample: zenoh.Sample) -> None:
        health = decode(Health, sample.payload.to_bytes(), str(sample.encoding))
        robot = str(sample.key_expr).partition("/svc/")[0]
        name = health.instance if robot.startswith("svc") else robot
        self.health[health.service, name] = health


@contextmanager
def processes(
    kind: Kind, count: int, fps: float, endpoint: str, folder: Path
) -> Iterator[dict[tuple[str, str], int]]:
    """All services of so many cameras or robots: process ids by service and name."""
    names = tuple(f"{kind[0]}{number}" for number in range(count))
    if kind == "robots":
        with robots(names, fps, endpoint, folder) as pids:
            yield pids
        return
    with started(names, PER_CAMERA, ("--camera", "--instance"), fps, endpoint, folder) as pids:
        yield pids


@contextmanager
def robots(
    names: tuple[str, ...], fps: float, endpoint: str, folder: Path
) -> Iterator[dict[tuple[str, str], int]]:
    """All services of some robots at one router: process ids by service and name."""
    with started(names, PER_ROBOT, ("--namespace",), fps, endpoint, folder) as pids:
        yield pids


@contextmanager
def started(
    names: tuple[str, ...], services: tuple[str, ...], named_by: tuple[str, ...], fps: float,
    endpoint: str, folder: Path,
) -> Iterator[dict[tuple[str, str], int]]:  # fmt: skip
    """Services under some names, which these flags give them."""
    environment = {name: value for name, value in os.environ.items() if name[:5] != "HEEL_"}
    environment |= {PARENT_VARIABLE: str(os.getpid()), "HEEL_MODELS": str(folder),
                    "HEEL_RUNTIME_DIR": str(folder)}  # fmt: skip
    running: dict[tuple[str, str], subprocess.Popen[bytes]] = {}
    try:
        for name in names:
            own = [word for flag in named_by for word in (flag, name)]
            for service in services:
                flags = [SCENE, "--loop", "--fps", f"{fps:g}"] if service == "capture" else []
                with (folder / f"{service}-{name}.log").open("wb") as log:
                    running[service, name] = subprocess.Popen(
                        [sys.executable, "-P", "-m", f"heel.services.{service}", *flags, *own,
                         "--connect", endpoint],
                        env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                    )  # fmt: skip
        yield {one: process.pid for one, process in running.items()}
    finally:
        for process in running.values():
            process.terminate()
        for process in running.values():
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def measure(kind: Kind, count: int, fps: float, seconds: float) -> Cost:
    """Run so many and measure them in their steady state."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        # Not in this process, whose own work is not the router's.
        endpoint, router_pid = stack.enter_context(router_process(folder / "router.log"))
        session = stack.enter_context(client(endpoint))
        listener = Listener(session, stack)
        pids = stack.enter_context(processes(kind, count, fps, endpoint, folder))

        def steady() -> bool | None:
            sent = [listener.health.get(one) for one in pids]
            return all(one is not None and one.sent >= _STEADY for one in sent) or None

        wait_for(steady, _START_S, f"{count} {kind}: not all of them send")
        before, router_before = dict(listener.health), _cpu_s(router_pid)
        began_s = time.monotonic()
        time.sleep(seconds)
        after, router_cpu_s = dict(listener.health), _cpu_s(router_pid) - router_before
        took_s = time.monotonic() - began_s
        memory = {one: _pss_mb(pid) for one, pid in pids.items()}
        router_mb = _pss_mb(router_pid)
        # They are those of one camera, however many there are.
        sizes = {} if count > 1 else _sizes(
            session, *(("c0", "") if kind == "cameras" else ("front", "r0/"))
        )  # fmt: skip
    frames = sum(after[one].sent - before[one].sent for one in pids if one[0] == "tracker")
    cpu_ms = {"router": 1e3 * router_cpu_s / frames}
    for one in pids:
        used_s = after[one].cpu_s - before[one].cpu_s
        cpu_ms[one[0]] = cpu_ms.get(one[0], 0.0) + 1e3 * used_s / frames
    dropped = sum(after[one].dropped - before[one].dropped for one in pids if one[0] == "tracker")
    return Cost(count, frames / took_s / count, cpu_ms, sum(memory.values()) / count, router_mb,
                dropped / (frames + dropped), sizes)  # fmt: skip


@contextmanager
def router_process(log_file: Path, *flags: str) -> Iterator[tuple[str, int]]:
    """A router in a process of its own: its endpoint, and its process id."""
    with open_private_router() as (_, endpoint):
        pass  # A port that was free.
    with log_file.open("wb") as log:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "heel", "router", "--listen", endpoint, *flags],
            stdin=subprocess.DEVNULL, stdout=log, stderr=log,
        )  # fmt: skip
    try:
        yield endpoint, process.pid
    finally:
        process.terminate()
        process.wait(10.0)


@contextmanager
def client(endpoint: str) -> Iterator[zenoh.Session]:
    """A client of a router; waits for it."""
    config = zenoh.Config()
    for path, value in (("mode", '"client"'), ("connect/endpoints", f'["{endpoint}"]'),
                        ("connect/timeout_ms", "60000"),
                        ("scouting/multicast/enabled", "false")):  # fmt: skip
        config.insert_json5(path, value)
    with zenoh.open(config) as session:
        yield session


def _sizes(session: zenoh.Session, camera: str, robot: str) -> dict[str, float]:
    """Mean bytes of a camera's blobs and tracks, and of a raw and a JPEG frame."""
    sizes: dict[str, list[int]] = {"blobs": [], "tracks": []}

    def note(sample: zenoh.Sample) -> None:
        topic = str(sample.key_expr).rpartition("/")[2]
        if topic in sizes:
            sizes[topic].append(len(sample.payload))

    with ExitStack() as stack:
        for topic in sizes:
            key = f"{robot}cam/{camera}/{topic}"
            stack.callback(session.declare_subscriber(key, note).undeclare)
        time.sleep(_SIZES_S)
    with open_source(SCENE) as source:
        pictures = [source.read() for _ in range(60)]
    images = [one.image for one in pictures if one is not None][::10]
    jpeg = [len(encode_image(image, "image/jpeg", 90)) for image in images]
    return {"raw": float(images[0].nbytes), "JPEG": float(np.mean(jpeg))} | {
        topic: float(np.mean(kept)) if kept else 0.0 for topic, kept in sizes.items()
    }


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS_HZ


def _pss_mb(pid: int) -> float:
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
        if line.startswith("Pss:"):
            return int(line.split()[1]) / 1024.0
    return 0.0


def pass_s() -> float:
    """Length of the scene [s].

    People come and go in it, and the tracker's time for a frame with them: by a factor of ten over
    the scene. What is measured for a part of it is the part.
    """
    with open_source(SCENE) as source:
        assert source.frame_count is not None
        return source.frame_count / source.fps


def table(kind: Kind, costs: list[Cost]) -> str:
    """One row for each number of cameras or robots."""
    services = ["router", *(PER_CAMERA if kind == "cameras" else PER_ROBOT)]
    one = kind[:-1]
    rows = [f"| {kind} | frames/s of each | " + " | ".join(f"{name} ms" for name in services)
            + f" | ms per frame and {one} | against one | MB per {one} | router MB | dropped |",
            "|" + "---|" * (len(services) + 7)]  # fmt: skip
    for cost in costs:
        against = cost.total_ms / costs[0].total_ms - 1.0
        rows.append(
            f"| {cost.count} | {cost.fps:.1f} | "
            + " | ".join(f"{cost.cpu_ms[name]:.1f}" for name in services)
            + f" | {cost.total_ms:.1f} | {against:+.0%} | {cost.memory_mb:.0f} | "
            f"{cost.router_mb:.0f} | {cost.dropped:.1%} |"
        )
    return "\n".join(rows)


def beyond(camera: Cost, robot: Cost) -> str:
    """Cores and bandwidth of many robots at 25 frames/s, from what one costs here."""
    size = camera.bytes_frame
    mbit = {name: size[name] * 8e-6 * FPS_ROBOT for name in ("raw", "JPEG", "blobs", "tracks")}
    rows = ["| robots | cores, all on board | cores of a server that detects and tracks for all | "
            "Mbit/s to it, JPEG | back, tracks |",
            "|---|---|---|---|---|"]  # fmt: skip
    clocked = ("follower", "drive")  # work by a clock of their own, whatever the camera's rate is
    board = sum(ms * (robot.fps if name in clocked else FPS_ROBOT)
                for name, ms in robot.cpu_ms.items()) * 1e-3  # fmt: skip
    heavy_ms = camera.cpu_ms["detector"] + camera.cpu_ms["tracker"]
    for count in (1, 4, 16, 64):
        rows.append(
            f"| {count} | {count * board:.1f} | "
            f"{count * heavy_ms * FPS_ROBOT * 1e-3:.1f} | {count * mbit['JPEG']:.0f} | "
            f"{count * mbit['tracks']:.1f} |"
        )
    told = ", ".join(f"{name} {size[name] / 1e3:.1f} kB" for name in mbit)
    most = "; ".join(
        f"{link}: {limit / mbit['JPEG']:.0f} cameras as JPEG, "
        f"{limit / mbit['tracks']:.0f} as tracks"
        for link, limit in LINKS_MBIT.items()
    )
    cores, seen = len(os.sched_getaffinity(0)), camera.total_ms * FPS_ROBOT * 1e-3
    ends = (
        f"At {FPS_ROBOT:g} frames/s a camera takes {seen:.2f} cores and a robot {board:.2f}: "
        f"{cores} cores end at {cores / seen:.1f} cameras, or {cores / board:.1f} robots."
    )
    return "\n".join(rows) + f"\n\n{ends} A frame of 640x480: {told}. What a link carries: {most}."


@app.command()
def main(
    passes: Annotated[int, typer.Option(help="of the scene in each measurement", min=1)] = 1,
    fps: Annotated[float, typer.Option(help="of every camera, so that four are kept up with")] = 8,
    most: Annotated[int, typer.Option(help="cameras and robots at most: 1, 2, 4, ...")] = 4,
    write: Write = None,
) -> None:
    """Print a table for cameras, one for robots, and what that means for more machines."""
    counts = [count for count in (1, 2, 4, 8) if count <= most]
    seconds = passes * pass_s()
    by_camera = [measure("cameras", count, fps, seconds) for count in counts]
    by_robot = [measure("robots", count, fps, seconds) for count in counts]
    text = "\n\n".join([
        f"{len(os.sched_getaffinity(0))} cores, `{SCENE}` at 640x480 and {fps:g} frames/s, "
        f"{seconds:.1f} s each ({passes} of the scene), standing background.",
        table("cameras", by_camera), table("robots", by_robot),
        beyond(by_camera[0], by_robot[0]),
    ])  # fmt: skip
    publish(text, write)


if __name__ == "__main__":
    run_app(app)
