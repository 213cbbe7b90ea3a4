"""`heel eval`: scores of tracks against ground truth, by TrackEval's rules."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer

Flags = Literal["mot15", "ignore", "all"]
"""What rows with flag 0 mean, as `heel.evaluation.alignment.FlagRule`."""


def score(
    ground_truth: Annotated[
        Path,
        typer.Argument(
            help="sequence folder or its gt.txt, or a folder of sequences", metavar="GT"
        ),
    ],
    tracks: Annotated[
        Path,
        typer.Argument(
            help="tracks.txt or its folder, or a folder of SEQUENCE.txt", metavar="TRACKS"
        ),
    ],
    iou: Annotated[float, typer.Option(help="least overlap of a match, IoU")] = 0.5,
    flags: Annotated[
        Flags,
        typer.Option(help="rows with flag 0: left out, ignore regions, or people like all others"),
    ] = "mot15",
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object a line")] = False,
    returns: Annotated[
        bool,
        typer.Option(
            "--returns",
            help="instead: the same id after absences of 1, 3, 5, 15 s, and how long losses last",
        ),
    ] = False,
    fps: Annotated[
        float | None, typer.Option(help="frames per second [default: of seqinfo.ini]")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="folder for accuracy and timeline plots", metavar="DIR")
    ] = None,
) -> None:
    """Score TRACKS against GT: MOTA, MOTP, IDF1, HOTA, switches, keep%, wrong%, Dice."""
    from heel.evaluation.sequence_scores import find_pairs

    if returns and plot is not None:
        raise typer.BadParameter("it draws no absences: leave --returns or --plot out")
    pairs = find_pairs(ground_truth, tracks)
    if returns:
        _print_returns(pairs, iou, flags, fps, as_json)
    else:
        _print_scores(pairs, iou, flags, plot, as_json)


def _print_scores(
    pairs: Sequence[tuple[Path, Path]], iou: float, flags: Flags, plot: Path | None, as_json: bool
) -> None:
    from rich.console import Console

    from heel.evaluation.sequence_scores import (
        load_sequence,
        score_sequence,
        scores_json,
        scores_table,
    )

    scores = []
    for truth, output in pairs:
        sequence = load_sequence(truth, output, iou_threshold=iou, flags=flags)
        scores.append(score_sequence(sequence, iou_threshold=iou))
        if plot is not None:
            from heel.evaluation.plots import write_plots

            for path in write_plots(sequence, plot, iou_threshold=iou):
                typer.echo(f"wrote {path}", err=True)
    if as_json:
        typer.echo(scores_json(scores))
    else:
        Console().print(scores_table(scores))


def _print_returns(
    pairs: Sequence[tuple[Path, Path]], iou: float, flags: Flags, fps: float | None, as_json: bool
) -> None:
    from rich.console import Console

    from heel.evaluation.returns import return_scores, returns_table
    from heel.evaluation.sequence_scores import find_frame_rate, load_sequence, scores_json

    scores = []
    for truth, output in pairs:
        sequence = load_sequence(truth, output, iou_threshold=iou, flags=flags)
        rate_hz = find_frame_rate(truth) if fps is None else fps
        scores.append(return_scores(sequence, rate_hz, iou))
    if as_json:
        typer.echo(scores_json(scores))
    else:
        Console().print(returns_table(scores))
