"""The paper's Figure 8 with today's ROS: the same cores as nodes of rclpy, as Heel's processes,
and in one process.

Pictures at a camera's rate, live. Of each arm: how old a picture is when its blobs, its tracks and
its command come to a listener, frames that led to no tracks, and processor time of all that works
(the listener not counted, start-up included). Arms take turns. ROS is rclpy with the middleware of
its wheels (Fast DDS) as it comes: no data sharing, no profiles, reliable topics.

Example run, by Python of an environment of `make test-ros2`:
.venv-ros2/bin/python -m benchmarks.ros2 --write docs/records/ros2.md
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks.common import NAMED_NETWORKS, REPOSITORY, Write, heel_run, publish
from benchmarks.ros.nodes import ROLES, STAGES
from heel.schemas import HeelError
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
_SOURCE = "scene:demo?width=768&height=576"
_END_S = 120.0
"""Longest wait for the end of a node [s], beyond the time of its pictures."""
_WORKING = ("capture", "detector", "tracker", "follower")


@dataclass
class Arm:
    """All runs of one way to put the cores together.

    Attributes:
        ages_ms: median and p95 of every run, by stage.
        lost: frames that led to no tracks.
        cpu_ms: processor time a frame, of every run.
    """

    ages_ms: dict[str, list[tuple[float, float]]] = field(
        default_factory=lambda: {stage: [] for stage in STAGES}
    )
    frames: int = 0
    lost: int = 0
    cpu_ms: list[float] = field(default_factory=list)

    def note(
        self, ages_ms: dict[str, tuple[float, float]], frames: int, tracked: int, cpu_s: float
    ) -> None:
        """Add a run."""
        for stage in STAGES:
            self.ages_ms[stage].append(ages_ms[stage])
        self.frames += frames
        self.lost += frames - tracked
        self.cpu_ms.append(cpu_s * 1e3 / frames)


def by_nodes(fps: float, frames: int, arm: Arm) -> None:
    """One process of rclpy for every core."""
    environment = {
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 99), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"
    }  # fmt: skip
    processes = {role: _node(role, fps, frames, environment) for role in reversed(ROLES)}
    told = {"camera": _told(processes.pop("camera"), frames / fps)}
    for process in processes.values():
        process.send_signal(signal.SIGTERM)
    told |= {role: _told(process, 0.0) for role, process in processes.items()}
    ages_ms: dict[str, list[float]] = told.pop("listener")["ages_ms"]
    cpu_s = sum(float(one["cpu_s"]) for one in told.values())
    arm.note(_percentiles(ages_ms), frames, len(ages_ms["tracks"]), cpu_s)


def by_processes(fps: float, frames: int, arm: Arm) -> None:
    """Heel's own, as `heel run --live` starts them."""
    with tempfile.TemporaryDirectory() as folder:
        summary = heel_run(
            _SOURCE, Path(folder), "--live", "--loop", "--fps", f"{fps:g}", "--seconds",
            f"{frames / fps:g}",
        )  # fmt: skip
    ages_ms = {
        stage: (one["median"], one["p95"]) for stage, one in summary["age_ms"].items()
    }  # fmt: skip
    captured, tracked = summary["frames"]["captured"], summary["frames"]["tracked"]
    cpu_s = sum(float(summary["cpu_s"][name]) for name in _WORKING)
    arm.note(ages_ms, captured, tracked, cpu_s)


def in_process(fps: float, frames: int, arm: Arm) -> None:
    """Called one after the other."""
    told = _told(_node("together", fps, frames, {}), frames / fps)
    ages_ms: dict[str, list[float]] = told["ages_ms"]
    arm.note(_percentiles(ages_ms), frames, len(ages_ms["tracks"]), float(told["cpu_s"]))


def _node(role: str, fps: float, frames: int, environment: dict[str, str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "benchmarks.ros.nodes", role, "--source", _SOURCE, "--fps",
         f"{fps:g}", "--frames", str(frames)],
        cwd=REPOSITORY, stdout=subprocess.PIPE, text=True,
        # As those of `heel run`: the kernel shares processors out among sessions.
        start_new_session=True,
        env={**os.environ, **NAMED_NETWORKS, **environment},
    )  # fmt: skip


def _told(process: subprocess.Popen[str], longest_s: float) -> dict[str, Any]:
    try:
        out, _ = process.communicate(timeout=longest_s + _END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        raise HeelError(f"{process.args!r} does not end") from None
    if process.returncode:
        raise HeelError(f"{process.args!r} failed")
    told: dict[str, Any] = json.loads(out.splitlines()[-1])
    return told


def _percentiles(ages_ms: dict[str, list[float]]) -> dict[str, tuple[float, float]]:
    return {
        stage: (float(np.median(ages)), float(np.percentile(ages, 95)))
        for stage, ages in ages_ms.items()
    }


def table(arms: dict[str, Arm]) -> str:
    """Markdown: one line for each arm, medians over its runs."""
    lines = [
        "| the cores as | blobs p50 | p95 | tracks p50 | p95 | command p50 | p95, ms | frames "
        "| lost | processor ms a frame |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, arm in arms.items():
        ages = [
            f"{np.median([run[which] for run in arm.ages_ms[stage]]):.1f}"
            for stage in STAGES for which in (0, 1)
        ]  # fmt: skip
        lines.append(
            f"| {name} | {' | '.join(ages)} | {arm.frames} | {arm.lost} "
            f"| {np.median(arm.cpu_ms):.1f} |"
        )
    return "\n".join(lines) + "\n"


@app.command()
def main(
    runs: Annotated[int, typer.Option(help="runs of each arm", min=1)] = 3,
    seconds: Annotated[float, typer.Option(help="length of each run")] = 15.0,
    fps: Annotated[float, typer.Option(help="pictures a second")] = 25.0,
    write: Write = None,
) -> None:
    """Compare the three and print a table."""
    frames = round(seconds * fps)
    measured: dict[str, tuple[Callable[[float, int, Arm], None], Arm]] = {
        "nodes of rclpy, Fast DDS": (by_nodes, Arm()),
        "Heel's processes, Zenoh": (by_processes, Arm()),
        "one process": (in_process, Arm()),
    }
    for turn in range(runs):
        order = list(measured.values())
        for run, arm in order if turn % 2 == 0 else reversed(order):
            run(fps, frames, arm)
    publish(table({name: arm for name, (_, arm) in measured.items()}), write, "figure 8")


if __name__ == "__main__":
    run_app(app)
