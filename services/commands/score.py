"""`heel eval`: scores of tracks against ground truth, by TrackEval's rules."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import typer


def score(
    ground_truth: Annotated[
        Path, typer.Argument(help="sequence folder, or its gt.txt", metavar="GT")
    ],
    tracks: Annotated[
        Path, typer.Argument(help="tracks.txt, or the folder it is in", metavar="TRACKS")
    ],
    iou: Annotated[float, typer.Option(help="least overlap of a match, IoU")] = 0.5,
    flags: Annotated[
        Literal["mot15", "ignore", "all"],
        typer.Option(help="rows with flag 0: left out, ignore regions, or people like all others"),
    ] = "mot15",
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
    plot: Annotated[
        Path | None, typer.Option(help="folder for accuracy and timeline plots", metavar="DIR")
    ] = None,
) -> None:
    """Score TRACKS against GT: MOTA, MOTP, IDF1, HOTA, switches, keep%, wrong%, Dice."""
    from rich.console import Console

    from evaluation.plots import write_plots
    from evaluation.report import load_sequence, score_sequence, scores_table

    sequence = load_sequence(ground_truth, tracks, iou_threshold=iou, flags=flags)
    scores = score_sequence(sequence, iou_threshold=iou)
    if as_json:
        typer.echo(json.dumps(scores.model_dump()))
    else:
        Console().print(scores_table([scores]))
    if plot is not None:
        for path in write_plots(sequence, plot, iou_threshold=iou):
            typer.echo(f"wrote {path}", err=True)
