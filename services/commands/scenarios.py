"""`heel scenarios`: the stack's cores in a closed loop with a simulated world, and its scores."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from schemas.errors import SettingsError

if TYPE_CHECKING:
    from rich.progress import Progress


def scenarios(
    episodes: Annotated[
        int, typer.Option(min=1, max=100_000, help="how many, the scenarios in turn")
    ] = 44,
    seed: Annotated[
        int, typer.Option(min=0, help="of the first world of each scenario; the others count up")
    ] = 0,
    jobs: Annotated[
        int | None, typer.Option(min=1, max=256, help="processes [default: one a core]")
    ] = None,
    scenario: Annotated[
        list[str] | None,
        typer.Option(help="only this one; may be repeated [default: all]", metavar="NAME"),
    ] = None,
    boxes: Annotated[
        bool,
        typer.Option(
            "--boxes/--pixels",
            help="the simulator's own person boxes with realistic errors, which is never the full "
            "stack; or rendered pictures and the detector",
        ),
    ] = True,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="folder for a picture and the scores of every episode", metavar="DIR"),
    ] = None,
    video: Annotated[
        bool, typer.Option("--video", help="also what the robot sees, as DIR/*.mp4; renders")
    ] = False,
    config: Annotated[
        Path | None, typer.Option(help="settings file (TOML)", metavar="FILE")
    ] = None,
) -> None:
    """Follow people through simulated scenarios, and score it."""
    import time
    from functools import partial

    from rich.console import Console

    from evaluation.scenarios.episode import load_stack, run_episode
    from evaluation.scenarios.parallel import run_all, spread
    from evaluation.scenarios.report import make_report, report_table, write_episodes
    from services.simulator.scenarios import SCENARIOS

    settings = load_stack("simulated boxes" if boxes else "pixels", config)
    if video and out is None:
        raise SettingsError("--video writes its films into a folder: give --out DIR, too")
    tasks = spread(scenario or list(SCENARIOS), episodes, seed, out, video)
    started_s = time.monotonic()
    with _progress() as progress:
        bar = progress.add_task("episodes", total=len(tasks))
        results = run_all(
            partial(run_episode, settings), tasks, jobs or os.cpu_count() or 1,
            lambda: progress.advance(bar),
        )  # fmt: skip
    report = make_report(results, seed, settings.mode, time.monotonic() - started_s)
    if out is not None:
        write_episodes(results, settings.mode, out / "episodes.jsonl")
    if as_json:
        typer.echo(report.model_dump_json())
    else:
        Console(soft_wrap=True).print(report_table(report))


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
