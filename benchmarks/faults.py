"""Every service is killed and frozen while the robot follows somebody, and comes back by itself.

The simulated robot follows a person through real processes: detector, tracker, follower, drive and
page. Where the detector itself is killed it sees rendered pixels; else the simulator's own boxes
stand for it, which leaves a small machine the time for everything else. At a random moment a
process gets SIGKILL, or SIGSTOP and never SIGCONT. Nobody does anything about it but what keeps the
processes: for *units* what `heel systemd` writes, carried out word for word by
`benchmarks.operating.units`; for *demo* `heel demo` itself.

A trial has recovered once a new process of the service is there and the robot follows the chosen
person again; the page, once it answers again while the robot follows. Times are from the fault.

Example run: python -m benchmarks.faults --trials 20 --write docs/records/faults.md
"""

from __future__ import annotations

import fcntl
import itertools
import json
import math
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal, Protocol

import numpy as np
import typer

from benchmarks.common import NAMED_NETWORKS, REPOSITORY, publish, wait_for
from benchmarks.operating.units import InitSystem
from benchmarks.operating.watch import Moment, Watch, fastest_mps
from heel.schemas import HeelError
from heel.services.drive.settings import DriveSettings
from heel.services.run.children import start_python
from heel.services.runtime.command_line import run_app
from heel.services.runtime.places import VARIABLE
from heel.services.runtime.registry import runs
from heel.services.runtime.shared_memory import SHARED_MEMORY
from heel.services.simulator.scenarios import scenario

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
Kept = Literal["units", "demo"]
FAULTS = {"SIGKILL": signal.SIGKILL, "SIGSTOP": signal.SIGSTOP}
SERVICES: dict[Kept, tuple[str, ...]] = {
    "units": ("router", "detector", "tracker", "follower", "drive", "web"),
    "demo": ("detector", "tracker", "follower", "drive", "web"),
}
"""In `heel demo` the router is the run's own process: the run ends with it."""
_CHAIN = ("detector", "tracker", "follower", "drive", "web")
GOAL_S = 5.0
"""The goal of a recovery."""
_GIVEN_UP_S = 20.0
"""Seconds after which a trial counts as not recovered."""
_START_S = 90.0
"""Longest wait [s] for a robot that follows, also on a busy machine."""
_STEADY_S = 1.0
"""For so long the robot follows before a fault; chosen by hand."""
_MOMENTS_S = 1.5
"""Faults come at a random moment within so many seconds; chosen by hand: frames, beats of the
watchdog and states on disk come once a second at least."""
_LEFT_S = 14.0
"""An episode that ends sooner than this begins no trial: with another world another person is
chosen. Chosen by hand."""
_STANDS_S = DriveSettings().ttl_s + 1.0
"""Seconds after a fault from which on the robot has to stand: the drive's own time, and 0.7 s in
which the simulated robot brakes from 1.6 m/s; chosen by hand."""
_HEARD_LATE_S = 0.5
"""So long before the new process was heard it may have driven already: a drive's first word is on
its way meanwhile, and simulated time is as old as the last frame. Chosen by hand."""
_LOOK_S = 0.02
_TAG = "HEEL_FAULTS_OF"


class Robot(Protocol):
    """One whose processes are kept by something."""

    endpoint: str
    truth: Path

    def pid(self, service: str) -> int | None:
        """Process number of a service."""

    def forgive(self) -> None:
        """Faults come in quick succession here: do not count them as one service's failure."""


@dataclass(frozen=True)
class Scene:
    """Which world, by scenario and first seed, and whether people are seen in pixels."""

    name: str
    seed: int
    pixels: bool

    @property
    def flags(self) -> tuple[str, ...]:
        """Of who shows it."""
        return "--perception", "pixels" if self.pixels else "simulated-boxes"


class Units:
    """A robot kept by what `heel systemd` writes; its world is a process beside it."""

    def __init__(self, folder: Path, scene: Scene, environment: dict[str, str],
                 stack: ExitStack) -> None:  # fmt: skip
        port = _free_port()
        self.endpoint, self.truth = f"tcp/127.0.0.1:{port}", folder / "truth.jsonl"
        environment = environment | {
            "HEEL_ZENOH__CONNECT": self.endpoint, "HEEL_ROUTER__LISTEN": self.endpoint,
            "HEEL_DRIVE__DRIVER": "simulated", "HEEL_WEB__PORT": str(_free_port()),
        }  # fmt: skip
        services = _CHAIN if scene.pixels else _CHAIN[1:]
        self._init = stack.enter_context(InitSystem(services, folder, environment))
        self.pid, self.forgive = self._init.pid, self._init.forgive
        with (folder / "simulator.log").open("ab") as log:
            world = start_python(
                ("-m", "heel.services.simulator", scene.name, "--seed", str(scene.seed), "--loop",
                 "--truth", str(self.truth), *scene.flags,
                 *(() if scene.pixels else ("--no-pictures",))), log, environment,
            )  # fmt: skip
        stack.callback(_end, world)


class Demo:
    """A robot kept by `heel demo`."""

    def __init__(self, folder: Path, scene: Scene, environment: dict[str, str],
                 stack: ExitStack) -> None:  # fmt: skip
        self.truth = folder / "truth.jsonl"
        with (folder / "demo.log").open("ab") as log:
            process = start_python(
                ("-m", "heel", "demo", "--scenario", scene.name, "--seed", str(scene.seed),
                 "--port", "0", "--no-browser", "--seconds", "100000", "--out", str(folder),
                 *scene.flags),
                log, environment,
            )  # fmt: skip
        stack.callback(_end, process)
        wait_for(lambda: runs() and runs()[0].pids, _START_S, f"no demo (see {folder})")
        self.endpoint = runs()[0].endpoint

    def pid(self, service: str) -> int | None:
        """As `Robot.pid`; the note may name a process that has just ended."""
        found = next((run.pids.get(service) for run in runs()), None)
        return found if found is not None and Path(f"/proc/{found}").exists() else None

    def forgive(self) -> None:
        """The demo counts, but every service has its turn before one comes again."""


@dataclass(frozen=True)
class Trial:
    """One fault and what became of it.

    Attributes:
        seconds: to the recovery; None if there was none.
        fastest_mps: true speed while it had to stand: from the time in which it brakes until the
            new process may drive; None where there was no such time.
        same: whether the target had the same id afterwards.
        asked: whether the follower asked to choose again.
        wrong: whether the robot acted upon anybody else.
    """

    kept: Kept
    service: str
    fault: str
    seconds: float | None
    fastest_mps: float | None
    same: bool
    asked: bool
    wrong: bool


@dataclass
class Remains:
    """What was left of robots after their end.

    Attributes:
        robots: that were ended.
        orphans: processes.
        files: in shared memory.
    """

    robots: int = 0
    orphans: int = 0
    files: int = 0


def table(trials: list[Trial]) -> str:
    """A row for each service and fault."""
    rows: dict[tuple[str, str, str], list[Trial]] = {}
    for one in sorted(trials, key=_place):
        rows.setdefault((one.kept, one.service, one.fault), []).append(one)
    return "\n".join([HEAD, *(_cells(name, row) for name, row in rows.items())]) + "\n"


def _place(one: Trial) -> tuple[object, ...]:
    kept = list(SERVICES).index(one.kept)
    return kept, SERVICES[one.kept].index(one.service), list(FAULTS).index(one.fault)


def _cells(name: tuple[str, str, str], row: list[Trial]) -> str:
    done = [one.seconds for one in row if one.seconds is not None]
    in_time = sum(seconds <= GOAL_S for seconds in done)
    middle, most = (f"{np.median(done):.1f}", f"{max(done):.1f}") if done else ("-", "-")
    speeds = [one.fastest_mps for one in row if one.fastest_mps is not None]
    speed = "drives on" if name[1] == "web" else f"{max(speeds):.2f}" if speeds else "-"
    same, asked, wrong = (sum(each) for each in zip(
        *((one.same, one.asked, one.wrong) for one in row), strict=True
    ))  # fmt: skip
    return (
        f"| {' | '.join(name)} | {len(row)} | {len(done)} | {in_time} | {middle} | {most} "
        f"| {speed} | {same} | {asked} | {wrong} |"
    )


HEAD = (
    "| kept by | service | fault | trials | recovered | within 5 s | s, median | max "
    "| m/s while out | same id | asked | wrong person |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|---|"
)


class Bench:
    """One robot, one watch, and the trials on it."""

    def __init__(self, robot: Robot, watch: Watch, scene: Scene, told: bool) -> None:
        self._robot, self._watch = robot, watch
        self._scene, self._told = scene, told

    def trial(self, kept: Kept, service: str, fault: str, wait_s: float) -> Trial:
        """One fault, after a wait of so many seconds."""
        self._await_following(time.monotonic())
        time.sleep(wait_s)
        watch = self._watch
        before = self._await_following(time.monotonic() - _STEADY_S)
        pid = wait_for(lambda: self._robot.pid(service), _START_S, f"no {service}")
        assert pid is not None
        process = watch.producers.get(service, ("", 0.0))[0]
        self._robot.forgive()
        at_s, t_s = time.monotonic(), before.t_s + time.monotonic() - before.at_s
        os.kill(pid, FAULTS[fault])
        back = None
        while back is None and time.monotonic() - at_s < _GIVEN_UP_S:
            time.sleep(_LOOK_S)
            back = self._recovered(service, pid, process, at_s)
        heard_s, back_s = back or (time.monotonic(), time.monotonic())
        out_s, silent_s = back_s - at_s, heard_s - at_s - _HEARD_LATE_S
        seen = watch.since(at_s)
        asked = any(one.asks for one in seen)
        trial = Trial(
            kept, service, fault, None if back is None else out_s,
            None if service == "web" or silent_s <= _STANDS_S else
            fastest_mps(self._robot.truth, t_s + _STANDS_S, t_s + silent_s),
            same=bool(seen) and not asked and seen[-1].target_id == before.target_id, asked=asked,
            wrong=any(one.role not in (None, "target") for one in seen),
        )  # fmt: skip
        if self._told:
            typer.echo(f"{kept} {service} {fault} {out_s:.2f} s: {self._timeline(at_s)}", err=True)
        return trial

    def _timeline(self, at_s: float) -> str:
        """Seconds since a fault, state, whom by truth, speed and distance, at every change."""
        told, words = "", []
        for one in self._watch.since(at_s):
            now = f"{one.state} {one.role or '-'} id {one.target_id}{' asks' if one.asks else ''}"
            if now != told:
                told = now
                seen = f"{one.linear_mps:.2f} m/s {one.away_m:.1f} m"
                words.append(f"{one.at_s - at_s:.2f} {now} {seen}")
        starts = {name: f"{heard_s - at_s:.2f}" for name, (_, heard_s) in
                  self._watch.producers.items() if heard_s > at_s}  # fmt: skip
        return f"{'; '.join(words)}; up: {starts}"

    def _recovered(
        self, service: str, pid: int, process: str, at_s: float
    ) -> tuple[float, float] | None:
        """When the new process was heard first and when the robot went on, if it has."""
        watch = self._watch
        if self._robot.pid(service) in (None, pid):
            return None
        since_s = at_s
        if service == "web":
            if not _answers(watch.page):
                return None
        elif service != "router":
            producer, since_s = watch.producers.get(service, ("", 0.0))
            if producer in ("", process):
                return None
            if service == "drive":
                sender, state, sends_since_s = watch.drive
                if sender != producer or state != "driving":
                    return None
                # Its wheels may turn before it tells of its health.
                since_s = min(since_s, sends_since_s)
        else:
            # What was heard before the router went away does not count.
            heard = [at_s, *(one.at_s for one in watch.since(at_s))]
            gaps = [later for sooner, later in itertools.pairwise(heard)
                    if later - sooner > _STEADY_S / 2]  # fmt: skip
            if not gaps:
                return None
            since_s = gaps[-1]
        moments = watch.since(since_s)
        following = bool(moments) and moments[-1].state == "following"
        return (since_s, time.monotonic()) if following and moments[-1].role == "target" else None

    def _await_following(self, since_s: float) -> Moment:
        """The newest moment, once the robot has followed for a while in an episode that goes on."""
        watch = self._watch

        def steady() -> Moment | None:
            now_s = time.monotonic()
            seen = watch.since(max(since_s, now_s - _STEADY_S))
            if not seen or seen[-1].at_s < now_s - 0.2 or now_s - since_s < _STEADY_S:
                return None
            seed = self._scene.seed + max(0, watch.episodes - 1)
            world = scenario(self._scene.name, seed).scenario
            if seen[-1].t_s > world.duration_s - _LEFT_S:
                return None
            good = all(one.state == "following" and one.role == "target" for one in seen)
            return seen[-1] if good else None

        found = wait_for(steady, _START_S, "the robot follows nobody")
        assert found is not None
        return found


@contextmanager
def bench(kept: Kept, scene: Scene, remains: Remains, told: bool) -> Iterator[Bench]:
    """A robot that is about to follow; afterwards nothing of it may be left."""
    before = set(SHARED_MEMORY.iterdir())
    with tempfile.TemporaryDirectory(prefix="heel-faults-") as name:
        folder = Path(name)
        environment = {
            key: value for key, value in os.environ.items() if not key.startswith("HEEL_")
        }  # fmt: skip
        environment |= NAMED_NETWORKS
        environment |= {"PYTHONPATH": str(REPOSITORY), VARIABLE: name, _TAG: name}
        try:
            with _robot(kept, folder, scene, environment, told) as made:
                yield made
        finally:
            remains.robots += 1
            remains.orphans += len(_tagged(name))
            left = _left(before)
            remains.files += len(left)
            if left:
                typer.echo(f"left: {', '.join(str(one) for one in sorted(left))}", err=True)


@contextmanager
def _robot(
    kept: Kept, folder: Path, scene: Scene, environment: dict[str, str], told: bool
) -> Iterator[Bench]:
    os.environ[VARIABLE] = str(folder)
    with ExitStack() as stack:
        stack.callback(os.environ.pop, VARIABLE)
        robot: Robot = (Units if kept == "units" else Demo)(folder, scene, environment, stack)
        watch = stack.enter_context(Watch(robot.endpoint, clicks=kept == "units"))
        try:
            yield Bench(robot, watch, scene, told)
        except HeelError:
            _show_logs(folder)
            raise


def _show_logs(folder: Path) -> None:
    for log in sorted(folder.rglob("*.log")):
        tail = log.read_text(errors="replace").splitlines()[-12:]
        sys.stderr.write(f"--- {log.name}\n" + "".join(f"{line[:300]}\n" for line in tail))


def _left(before: set[Path]) -> set[Path]:
    """New files of Heel's and Zenoh's in shared memory that no living process holds."""
    found = {path for path in SHARED_MEMORY.iterdir() if path.suffix in (".zenoh", ".ledger")}
    return {path for path in found - before if not _held(path)}


def _held(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, FileNotFoundError):
        return True
    return False


def _tagged(name: str) -> list[int]:
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if f"{_TAG}={name}".encode() in (entry / "environ").read_bytes():
                found.append(int(entry.name))
    return found


def _answers(page: str) -> bool:
    try:
        with urllib.request.urlopen(page, timeout=0.5) as reply:
            return bool(reply.status == 200)
    except (urllib.error.URLError, OSError, ValueError):
        return False


def _end(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(15.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@app.command()
def main(
    trials: Annotated[int, typer.Option(help="of each service and fault", min=1)] = 20,
    kept: Annotated[str, typer.Option(help="units, demo")] = "units,demo",
    only: Annotated[str, typer.Option(help="services")] = "",
    fault: Annotated[str, typer.Option(help="SIGKILL, SIGSTOP")] = "SIGKILL,SIGSTOP",
    scene: Annotated[str, typer.Option(help="scenario of the world")] = "straight",
    seed: Annotated[int, typer.Option(help="of the moments and of the first world")] = 1,
    seconds: Annotated[float, typer.Option(help="begin no trial after so long")] = math.inf,
    keep: Annotated[
        Path | None, typer.Option(help="go on with the trials of this file", metavar="FILE")
    ] = None,
    timeline: Annotated[bool, typer.Option(help="print what was seen in every trial")] = False,
    write: Annotated[Path | None, typer.Option(help="page for the table", metavar="FILE")] = None,
) -> None:
    """Kill and freeze; prints a table."""
    done, remains = _kept_trials(keep)
    until_s = time.monotonic() + seconds
    for by in SERVICES:
        services = [one for one in SERVICES[by] if by in kept and (not only or one in only)]
        for pixels in (False, True):
            todo = [(service, kind) for service in services if (service == "detector") == pixels
                    for kind in FAULTS if kind in fault]  # fmt: skip
            while time.monotonic() < until_s and _short(done, by, todo, trials):
                world = Scene(scene, seed + len(done), pixels)
                with suppress(HeelError), bench(by, world, remains, timeline) as made:
                    _try(made, by, todo, trials, done, until_s, seed)
                _keep(keep, done, remains)
    left = (
        f"\nLeft by {remains.robots} robots after their end: {remains.orphans} processes, "
        f"{remains.files} files in /dev/shm.\n"
    )
    publish(table(done) + (left if remains.robots else ""), write, "faults")


def _try(
    made: Bench, by: Kept, todo: list[tuple[str, str]], trials: int, done: list[Trial],
    until_s: float, seed: int,
) -> None:  # fmt: skip
    """One after the other, so that no service fails too often within a minute.

    Raises:
        HeelError: the robot has not recovered, and is of no use any more.
    """
    while short := _short(done, by, todo, trials):
        service, fault = short[0]
        if time.monotonic() >= until_s:
            return
        wait_s = random.Random(f"{seed} {len(done)}").uniform(0.0, _MOMENTS_S)
        done.append(made.trial(by, service, fault, wait_s))
        if done[-1].seconds is None:
            raise HeelError(f"{service} has not recovered from {fault}")


def _short(
    done: list[Trial], by: Kept, todo: list[tuple[str, str]], trials: int
) -> list[tuple[str, str]]:
    """What has fewer trials than wanted, the fewest first."""
    had = Counter((one.service, one.fault) for one in done if one.kept == by)
    return sorted((one for one in todo if had[one] < trials), key=lambda one: had[one])


def _kept_trials(keep: Path | None) -> tuple[list[Trial], Remains]:
    if keep is None or not keep.exists():
        return [], Remains()
    kept = json.loads(keep.read_text())
    return [Trial(**one) for one in kept["trials"]], Remains(**kept["remains"])


def _keep(keep: Path | None, done: list[Trial], remains: Remains) -> None:
    if keep is not None:
        kept = {"trials": [asdict(one) for one in done], "remains": asdict(remains)}
        keep.write_text(json.dumps(kept, indent=1))


if __name__ == "__main__":
    run_app(app)
