"""`heel demo`: a drawn scene through the real processes, the live page, and the scores."""

from __future__ import annotations

import logging
import sys
import tempfile
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from schemas.errors import HeelError
from services.commands.run import PARENT_EXIT_S
from services.run.guard import guarded
from services.run.options import RunOptions

SCENE = "scene:demo"


def demo(
    seconds: Annotated[
        float | None,
        typer.Option(
            help="end after so many seconds [default: Ctrl-C; one pass of "
            "the scene without a terminal]"
        ),
    ] = None,
    port: Annotated[int, typer.Option(help="port of the live page, 0 for any free one")] = 8470,
    out: Annotated[
        Path | None,
        typer.Option(help="folder for the results [default: a temporary one]", metavar="DIR"),
    ] = None,
    browser: Annotated[bool, typer.Option(help="open the page in a browser")] = True,
) -> None:
    """Play a drawn scene through all services; needs no camera, no data, nothing else."""
    folder = out if out is not None else Path(tempfile.mkdtemp(prefix="heel-demo-"))
    on_terminal = sys.stdout.isatty()
    loop = seconds is not None or on_terminal
    options = RunOptions(
        source=SCENE, out=folder, delivery="live", loop=loop, seconds=seconds, web_port=port,
        on_page=lambda url: _show_page(url, browser and on_terminal, loop and seconds is None),
    )  # fmt: skip
    raise typer.Exit(guarded(lambda: _work(options)))


def _work(options: RunOptions) -> None:
    # Imported here, in the guarded process: see `guarded`.
    from services.run.distributed import DistributedRun
    from services.run.report import print_summary
    from services.runtime.service import stop_signals

    logging.basicConfig(format="heel: %(message)s", level=logging.WARNING)
    with stop_signals(PARENT_EXIT_S) as stopping:
        summary = DistributedRun(options, stopping, logging.getLogger("heel.demo")).run()
    print_summary(summary, options.out)
    _print_scores(options.out)


def _show_page(url: str, browser: bool, endless: bool) -> None:
    typer.echo(f"live page: {url}" + ("  (Ctrl-C ends)" if endless else ""))
    if browser:
        webbrowser.open(url)


def _print_scores(folder: Path) -> None:
    """Score the first pass of the scene against what was drawn."""
    from rich.console import Console

    from evaluation.motchallenge import read_tracks
    from evaluation.report import evaluate, scores_table
    from services.pipeline import scene_truth

    truth = scene_truth(SCENE)
    (folder / "gt.txt").write_text("".join(truth.rows), encoding="ascii")
    tracks = folder / "tracks.txt"
    if not tracks.read_text(encoding="ascii"):
        typer.echo("nobody was tracked: there is nothing to score")
        return
    last = int(read_tracks(tracks).frames.max())
    scored = folder / "first-pass"
    scored.mkdir(exist_ok=True)
    for name in ("gt.txt", "tracks.txt"):
        lines = (folder / name).read_text(encoding="ascii").splitlines(keepends=True)
        limit = min(last, truth.frame_count)
        kept = [line for line in lines if int(line.partition(",")[0]) <= limit]
        (scored / name).write_text("".join(kept), encoding="ascii")
    try:
        scores = evaluate(scored / "gt.txt", scored / "tracks.txt")
    except HeelError as error:
        typer.echo(f"no scores: {error}")
        return
    Console().print(scores_table([scores.model_copy(update={"sequence": SCENE})]))
