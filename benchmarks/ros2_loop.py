"""The whole loop over ROS 2: a simulated robot's camera in by ROS, its wheels out by ROS.

The robot is a process of rclpy, or of zenoh-ros2-sdk, in an environment of its own; `heel ros2`,
detector, tracker, follower and drive are Heel's usual processes, by DDS the bridge in the robot's
environment, else all in one without any ROS. Episodes run in real time and are scored as those of
`heel scenarios`; kills are SIGKILLs of each of Heel's processes while the robot drives, and count
until its base stands: it has heard zero, or nothing for 0.2 s.

Example run: python -m benchmarks.ros2_loop --python .venv-ros2/bin/python --kills 20
"""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks.common import Write, publish, wait_for
from benchmarks.ros.stack import CHAIN, Choices, Stack, stands_after
from heel.schemas import HeelError, SimTruth
from heel.services.loops.scenarios.episode import load_stack, play_and_judge
from heel.services.loops.scenarios.parallel import EpisodeTask
from heel.services.loops.scenarios.results import EpisodeResult
from heel.services.loops.scenarios.witness import Witness
from heel.services.run.scenario import OneEpisode
from heel.services.runtime.command_line import run_app
from heel.services.simulator.scenarios import SCENARIOS, scenario

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
BOUND_S = 1.0
"""Longest time until the base stands [s]: tracks of an older picture than 0.22 s
count for nothing, a command lives for 0.5 s, the bridge waits 0.2 s for the drive."""
_DRIVES_MPS = 0.1
_WATCHED_S = 2.0
"""Time after a kill in which a velocity that is not zero would be noticed [s]."""
_DRIVING_S = 40.0


def episode(choices: Choices, task: EpisodeTask) -> EpisodeResult:
    """Play one and score it."""

    def play(task: EpisodeTask) -> Witness:
        log = OneEpisode(Witness(scenario(task.scenario, task.seed)))
        with tempfile.TemporaryDirectory() as folder:
            with Stack(Path(folder), choices, task.scenario, task.seed) as stack:
                stack.play(log, lambda truth: truth.contact > 0)
        return log.witness

    return play_and_judge(lambda one: play(one).log(), load_stack("pixels", None), task)


def kill(choices: Choices, name: str, seed: int) -> float:
    """Milliseconds from SIGKILL until the base stands.

    Raises:
        HeelError: the robot does not come to drive.
    """
    with tempfile.TemporaryDirectory() as folder:
        with Stack(Path(folder), choices, "straight", seed) as stack:
            begun_s = time.monotonic()

            def drives(_: SimTruth) -> bool:
                if time.monotonic() - begun_s > _DRIVING_S:
                    raise HeelError("the robot does not drive: nothing to measure")
                return bool(stack.told.velocities and stack.told.velocities[-1][1] > _DRIVES_MPS)

            stack.play(OneEpisode(Witness(scenario("straight", seed))), drives)
            killed_s = stack.kill(name)
            wait_for(lambda: time.monotonic() - killed_s > _WATCHED_S, 2 * _WATCHED_S, "no time")
            return stands_after(stack.told.velocities, killed_s) * 1e3


def kills_table(times_ms: dict[str, list[float]]) -> str:
    """Markdown: one line for each process."""
    lines = ["| killed | trials | p50 | max | bound, ms |", "|---|---|---|---|---|"]
    for name, values in {**times_ms, "all": [t for one in times_ms.values() for t in one]}.items():
        if values:
            lines.append(f"| {name} | {len(values)} | {np.median(values):.0f} | {max(values):.0f} "
                         f"| {BOUND_S * 1e3:.0f} |")  # fmt: skip
    return "\n".join(lines) + "\n"


def episodes_table(results: list[EpisodeResult]) -> str:
    """Markdown: one line for each episode, and the sum."""
    lines = ["| scenario | seed | SR | contact | wrong % |", "|---|---|---|---|---|"]
    for one in results:
        scores = one.scores
        lines.append(f"| {one.scenario} | {one.seed} | {scores.evt.success:.0f} | "
                     f"{scores.evt.collision:.0f} | {100 * scores.wrong_time:.2f} |")  # fmt: skip
    success = np.mean([one.scores.evt.success for one in results])
    lines.append(f"| **all {len(results)}** | | **{success:.2f}** | | |")
    return "\n".join(lines) + "\n"


@app.command()
def main(
    python: Annotated[str, typer.Option(help="of an environment with ROS")],
    rmw: Annotated[str, typer.Option(help="dds or zenoh")] = "dds",
    names: Annotated[list[str] | None, typer.Option("--scenario", help="these only")] = None,
    episodes: Annotated[
        bool, typer.Option("--episodes/--no-episodes", help="play one episode of each")
    ] = True,
    kills: Annotated[int, typer.Option(help="SIGKILL trials", min=0)] = 0,
    seed: Annotated[int, typer.Option(help="of the worlds")] = 1,
    model: Annotated[str, typer.Option(help="network of the detector")] = "none",
    kept: Annotated[
        Path | None, typer.Option(help="folder to which results are added; tables are of all in it")
    ] = None,
    write: Write = None,
) -> None:
    """Play episodes, kill processes, and print what came of it."""
    choices = Choices(rmw, python, model)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) if kept is None else kept
        folder.mkdir(parents=True, exist_ok=True)
        played, killed = folder / f"{rmw}-episodes.jsonl", folder / f"{rmw}-kills.jsonl"
        for name in (names or SCENARIOS) if episodes else ():
            _add(played, episode(choices, EpisodeTask(name, seed)).model_dump_json())
        for trial in range(kills):
            name = CHAIN[trial % len(CHAIN)]
            _add(killed, json.dumps([name, kill(choices, name, seed + trial)]))
        _tell(played, killed, rmw, write)


def _add(file: Path, line: str) -> None:
    typer.echo(line, err=True)
    with file.open("a", encoding="utf-8") as stream:
        stream.write(line + "\n")


def _tell(played: Path, killed: Path, rmw: str, write: Path | None) -> None:
    """Print the tables of what there is.

    Raises:
        HeelError: a kill took longer than it may.
    """
    if played.exists():
        lines = played.read_text("utf-8").splitlines()
        results = [EpisodeResult.model_validate_json(line) for line in lines]
        publish(episodes_table(results), write, f"{rmw} episodes")
    if killed.exists():
        times_ms: dict[str, list[float]] = {name: [] for name in CHAIN}
        for line in killed.read_text("utf-8").splitlines():
            name, time_ms = json.loads(line)
            times_ms[name].append(time_ms)
        publish(kills_table(times_ms), write, f"{rmw} kills")
        slow = [name for name, all_ms in times_ms.items() if max(all_ms, default=0) > BOUND_S * 1e3]
        if slow:
            raise HeelError(f"too slow: {', '.join(slow)}")


if __name__ == "__main__":
    run_app(app)
