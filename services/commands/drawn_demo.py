"""`heel demo --scene`: a drawn scene through the real processes, the live page, and the scores."""

from __future__ import annotations

import logging
from pathlib import Path

import typer

from heel.schemas.errors import HeelError
from heel.services.commands.shared_options import PARENT_EXIT_S
from heel.services.run.options import RunOptions


def results_in(folder: Path, kept: bool) -> str:
    """The line that ends a demo."""
    return f"results in {folder}" if kept else "nothing is kept: --out DIR keeps results and logs"


def play_scene(options: RunOptions, kept: bool) -> None:
    """Run the scene and score its first pass; `kept` is whether the folder stays."""
    # Imported here, in the guarded process: see `guarded`.
    from heel.services.run.checks import check_options
    from heel.services.run.distributed import DistributedRun
    from heel.services.run.summary import print_summary
    from heel.services.runtime.logs import set_up_command_logging
    from heel.services.runtime.stop_signals import stop_signals

    set_up_command_logging()
    check_options(options)
    with stop_signals(PARENT_EXIT_S) as stopping:
        summary = DistributedRun(options, stopping, logging.getLogger("heel.demo")).run()
    print_summary(summary, results_in(options.out, kept))
    _print_scores(options.source, options.out)


def _print_scores(scene: str, folder: Path) -> None:
    """Score the first pass of the scene against what was drawn."""
    from rich.console import Console

    from heel.evaluation.motchallenge import read_tracks
    from heel.evaluation.sequence_scores import evaluate, scores_table
    from heel.services.pipeline import scene_truth

    if not (folder / "tracks.txt").is_file():
        return
    truth = scene_truth(scene)
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
    Console().print(scores_table([scores.model_copy(update={"sequence": scene})]))
