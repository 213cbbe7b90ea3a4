"""`heel report`: a run or a recording as one page, for a bug report."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heel.schemas.errors import HeelError

if TYPE_CHECKING:
    from heel.services.commands.report.facts import Facts

_MOST_CROPS = 28
"""Pictures of the target: two or three rows of the page; chosen by hand."""
_FILM = "annotated.mp4"


def report(
    out: Annotated[
        Path, typer.Argument(help="folder of heel run --out, or a recording", metavar="OUT")
    ],
    to: Annotated[
        Path | None,
        typer.Option("--to", help="the page [default: report.html in the folder, or beside the "
                     "recording with its name]", metavar="HTML"),
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(help="ground truth, for scores, as of heel eval", metavar="GT")
    ] = None,
    trace: Annotated[
        Path | None, typer.Option(help="of heel run --trace: why each doubt", metavar="FILE")
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(help="what was run, for pictures of the target [default: annotated.mp4 of "
                     "the run]", metavar="SOURCE"),
    ] = None,
) -> None:  # fmt: skip
    """Tell a run or a recording as one HTML page: doubts, stops, speeds, distances, ages."""
    from heel.services.commands.report.page import as_html

    facts = _of_folder(out, trace, frames, truth) if out.is_dir() else _of_file(out, truth)
    place = to or (out / "report.html" if out.is_dir() else out.with_suffix(".html"))
    _write(place, as_html(facts))
    typer.echo(f"wrote {place}")


def _of_folder(folder: Path, trace: Path | None, frames: str | None, truth: Path | None) -> Facts:
    from heel.services.commands.report.crops import of_pictures
    from heel.services.commands.report.facts import picked
    from heel.services.commands.report.run_folder import TRACKS, read_run

    facts = read_run(folder, trace)
    film = folder / _FILM
    live = ("delivery", "live") in facts.about
    pictures = Path(frames) if frames else (film if film.is_file() and not live else None)
    if pictures is None:
        facts.notes.append(
            "no pictures of the target: `heel report --frames SOURCE`, with what was run"
        )
    else:
        wanted = picked(facts.sightings, (one.t_s for one in facts.events), _MOST_CROPS)
        facts.crops = of_pictures(pictures, wanted, facts.notes.append)
    if truth is not None:
        _score(facts, truth, folder / TRACKS)
    return facts


def _of_file(file: Path, truth: Path | None) -> Facts:
    from heel.services.commands.report.crops import of_recording
    from heel.services.commands.report.facts import picked
    from heel.services.commands.report.recording import read_recording

    facts, rows = read_recording(file)
    wanted = picked(facts.sightings, (one.t_s for one in facts.events), _MOST_CROPS)
    facts.crops = of_recording(file, wanted)
    if truth is not None:
        with tempfile.TemporaryDirectory() as folder:
            tracks = Path(folder) / "tracks.txt"
            tracks.write_text("".join(rows))
            _score(facts, truth, tracks)
    return facts


def _score(facts: Facts, truth: Path, tracks: Path) -> None:
    from heel.evaluation.sequence_scores import evaluate

    scores = evaluate(truth, tracks)
    facts.scored_by = f"{truth}, IoU 0.5"
    facts.scores += [
        (name.upper() if name in ("mota", "idf1", "hota") else name, text)
        for name, value in scores.model_dump().items()
        if name != "sequence"
        for text in [f"{value:.1f} %" if isinstance(value, float) else str(value)]
    ]


def _write(place: Path, text: str) -> None:
    """Write the page, whole or not at all; pictures of people are in it.

    Raises:
        HeelError: it cannot be written.
    """
    whole = place.with_name(f".{place.name}.{os.getpid()}")
    try:
        descriptor = os.open(whole, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with open(descriptor, "w", encoding="utf-8") as file:
            file.write(text)
        whole.replace(place)
    except OSError as error:
        whole.unlink(missing_ok=True)
        raise HeelError(
            f"--to {place}: {error.strerror}: give a file that can be written"
        ) from None
