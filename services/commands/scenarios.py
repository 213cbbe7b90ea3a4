"""`heel scenarios`: the stack's cores in a closed loop with a simulated world, and its scores."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heel.schemas.errors import SettingsError
from heel.services.commands.shared_options import (
    PARENT_EXIT_S,
    Config,
    Detector,
    ModelClass,
    ModelHead,
    NamedModel,
)

if TYPE_CHECKING:
    from rich.progress import Progress

    from heel.services.loops.scenarios.episode import StackSettings
    from heel.services.loops.scenarios.parallel import EpisodeTask, Run
    from heel.services.loops.scenarios.results import EpisodeResult, Mode, ScenarioReport


_Episodes = Annotated[int, typer.Option(min=1, max=100_000, help="how many, the scenarios in turn")]
_Seed = Annotated[
    int, typer.Option(min=0, help="of the first world of each scenario; the others count up")
]
_Jobs = Annotated[int | None, typer.Option(min=1, max=256, help="processes [default: one a core]")]
_Scenario = Annotated[
    list[str] | None,
    typer.Option(help="only this one; may be repeated [default: all]", metavar="NAME"),
]
_Boxes = Annotated[
    bool,
    typer.Option(
        "--boxes/--pixels",
        help="the simulator's own person boxes with realistic errors, which is never the full "
        "stack; or rendered pictures and the detector",
    ),
]
_Postures = Annotated[
    bool,
    typer.Option(
        "--postures",
        help="people who bend, sit, crouch or fall, children, a wheelchair, a table, instead of "
        "upright adults",
    ),
]
_Everyday = Annotated[
    bool,
    typer.Option(
        "--everyday",
        help="people who are out of view at first, leave through a door, meet their twin out of "
        "sight, hug, sit down, carry a box, are pushed in a wheelchair, or are children, instead",
    ),
]
_Ranges = Annotated[
    bool, typer.Option("--ranges/--no-ranges", help="whether the robot has range sensors")
]
_Calibrated = Annotated[
    bool,
    typer.Option("--calibrated/--uncalibrated", help="whether the camera's mounting is known"),
]
_Depth = Annotated[
    bool,
    typer.Option(
        "--depth",
        help="a camera that measures depth, too, by which people are placed; without ranges, "
        "obstacles are seen by it, if the mounting is known; renders",
    ),
]
_Processes = Annotated[
    bool,
    typer.Option(
        "--processes",
        help="through the real processes, in real time and one at a time, instead of their "
        "cores on a simulated clock",
    ),
]
_Json = Annotated[bool, typer.Option("--json", help="print one JSON object")]
_Out = Annotated[
    Path | None,
    typer.Option(help="folder for a picture and the scores of every episode", metavar="DIR"),
]
_Video = Annotated[
    bool, typer.Option("--video", help="also what the robot sees, as DIR/*.mp4; renders")
]


def scenarios(
    episodes: _Episodes = 42, seed: _Seed = 0, jobs: _Jobs = None, scenario: _Scenario = None,
    boxes: _Boxes = True, detector: Detector = None, model: NamedModel = None,
    model_class: ModelClass = None, model_head: ModelHead = None, processes: _Processes = False,
    as_json: _Json = False,
    out: _Out = None, video: _Video = False, config: Config = None, postures: _Postures = False,
    everyday: _Everyday = False, ranges: _Ranges = True, calibrated: _Calibrated = True,
    depth: _Depth = False,
) -> None:  # fmt: skip
    """Follow people through simulated scenarios, and score it."""
    from heel.services.loops.scenarios.parallel import spread
    from heel.services.simulator.everyday_scenarios import EVERYDAY
    from heel.services.simulator.posture_scenarios import POSTURES
    from heel.services.simulator.scenarios import SCENARIOS

    groups = [*[EVERYDAY] * everyday, *[POSTURES] * postures] or [SCENARIOS]
    names = scenario or list(dict.fromkeys(name for group in groups for name in group))
    if processes and (depth or not (ranges and calibrated)):
        raise SettingsError("--processes has ranges and a calibration, and no depth: leave out "
                            "--no-ranges, --uncalibrated and --depth")  # fmt: skip
    _check(names, boxes, processes, video, out)
    if boxes and (detector is not None or model is not None):
        raise SettingsError("--detector and --model look at pixels, and the people here are the "
                            "simulator's own boxes: add --pixels")  # fmt: skip
    tasks = spread(names, episodes, seed, out, video)
    mode: Mode = "simulated boxes" if boxes else "pixels"
    if processes:
        from heel.services.run.guard import guarded

        raise typer.Exit(guarded(lambda: _run_processes(tasks, seed, config, as_json, out)))
    from heel.services.loops.scenarios.episode import load_stack
    from heel.services.loops.scenarios.perception import Senses

    stack = load_stack(mode, config, detector, model, model_class, model_head)
    stack = replace(stack, senses=Senses(ranges, calibrated, depth))
    _run_cores(tasks, seed, stack, jobs, as_json, out)


def _check(names: list[str], boxes: bool, processes: bool, video: bool, out: Path | None) -> None:
    from heel.services.simulator.scenarios import EVERY

    if unknown := [name for name in names if name not in EVERY]:
        raise SettingsError(f"no scenario {unknown[0]!r}: choose of {', '.join(EVERY)}")
    if video and out is None:
        raise SettingsError("--video writes its films into a folder: give --out DIR, too")
    if processes and (video or not boxes):
        raise SettingsError("--processes runs on simulated boxes and films nothing: leave out "
                            "--pixels and --video")  # fmt: skip


def _run_cores(
    tasks: list[EpisodeTask], seed: int, stack: StackSettings, jobs: int | None, as_json: bool,
    out: Path | None,
) -> None:  # fmt: skip
    from heel.services.loops.scenarios.episode import run_episode
    from heel.services.loops.scenarios.results import make_report

    results, wall_s = _run_all(partial(run_episode, stack), tasks, jobs or os.cpu_count() or 1)
    report = make_report(results, seed, stack.mode, wall_s, senses=stack.senses)
    _tell(report, results, as_json, out)


def _run_processes(
    tasks: list[EpisodeTask], seed: int, config: Path | None, as_json: bool, out: Path | None
) -> None:
    from heel.services.loops.scenarios.episode import load_stack
    from heel.services.loops.scenarios.results import make_report
    from heel.services.run.scenario import run_in_processes
    from heel.services.runtime.stop_signals import stop_signals

    mode: Mode = "simulated boxes"
    with stop_signals(PARENT_EXIT_S) as stopping:
        run = partial(run_in_processes, load_stack(mode, config), config, stopping)
        results, wall_s = _run_all(run, tasks, 1)
    _tell(make_report(results, seed, mode, wall_s, "processes"), results, as_json, out)


def _run_all(run: Run, tasks: list[EpisodeTask], jobs: int) -> tuple[list[EpisodeResult], float]:
    from heel.services.loops.scenarios.parallel import run_all

    started_s = time.monotonic()
    with _progress() as progress:
        bar = progress.add_task("episodes", total=len(tasks))
        results = run_all(run, tasks, jobs, lambda: progress.advance(bar))
    return results, time.monotonic() - started_s


def _tell(
    report: ScenarioReport, results: list[EpisodeResult], as_json: bool, out: Path | None
) -> None:
    from rich.console import Console

    from heel.services.loops.scenarios.results import field_table, report_table, write_episodes

    if out is not None:
        write_episodes(results, report.mode, out / "episodes.jsonl")
    if as_json:
        typer.echo(report.model_dump_json())
    else:
        console = Console(soft_wrap=True)
        console.print(report_table(report))
        console.print(field_table(report))


def _progress() -> Progress:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    console = Console(file=sys.stderr)
    return Progress(
        TextColumn("episodes"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
        console=console, disable=not console.is_terminal,
    )  # fmt: skip
