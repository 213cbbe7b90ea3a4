"""The tracker on given boxes beside four public trackers: prints the table of docs/association.md.

Protocol: boxes of det.txt, every frame from the first, online, IoU 0.5, MOT15 ground truth with
flag-0 rows left out, one setting for all sequences, no pictures.

Example run: python -m benchmarks.association --write docs/association.md
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks.accuracy import replace_between
from benchmarks.association_baselines import BASELINES, BaselineScores
from benchmarks.association_calibration import Claim, claims_of, reliability_table
from benchmarks.common import data_folder
from evaluation.motchallenge import read_ground_truth, write_tracks
from evaluation.report import evaluate
from schemas.errors import HeelError
from services.commands.track_detections import read_given, shown_rows
from services.runtime.command_line import run_app
from services.tracker.given_boxes.sequence import GivenSequence, track_sequence

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
OURS = "Heel"
TRUE_BOXES = "PETS09-S2L1"


def sequences() -> list[Path]:
    """Folders with boxes and ground truth.

    Raises:
        HeelError: there is none.
    """
    found = sorted(path.parent.parent for path in data_folder().rglob("det/det.txt"))
    if not found:
        raise HeelError(f"no det/det.txt in {data_folder()}: set HEEL_DATA to the recordings")
    return found


def true_boxes(folder: Path) -> GivenSequence:
    """The ground truth of a sequence as if a perfect detector had found it, without ids."""
    truth = read_ground_truth(folder / "gt" / "gt.txt")
    truth = truth.select(truth.values != 0)
    scores = np.ones(len(truth))
    given = read_given(folder)
    return replace(given, frames=truth.frames, boxes=truth.boxes_xyxy, scores=scores)


def measure(folder: Path, given: GivenSequence, name: str) -> tuple[BaselineScores, list[Claim]]:
    """Scores and CPU milliseconds a frame of one sequence, and what its ids claimed."""
    started_s = time.process_time()
    tracked = list(track_sequence(given))
    milliseconds = 1e3 * (time.process_time() - started_s) / max(len(tracked), 1)
    rows = shown_rows(tracked)
    with tempfile.TemporaryDirectory() as out:
        file = Path(out) / "tracks.txt"
        write_tracks(file, rows)
        scores = evaluate(folder, file)
    found = BaselineScores(
        name, OURS, scores.mota, scores.idf1, scores.keep, scores.wrong, scores.idsw, milliseconds
    )
    return found, claims_of(read_ground_truth(folder / "gt" / "gt.txt"), rows)


def table(ours: list[BaselineScores]) -> str:
    """The Markdown table, ours first on every sequence."""
    head = ("sequence", "tracker", "MOTA", "IDF1", "keep%", "wrong%", "IDsw", "ms/frame")
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for own in ours:
        for one in (own, *(base for base in BASELINES if base.sequence == own.sequence)):
            name = f"**{one.tracker}**" if one is own else one.tracker
            values = (f"{value:.1f}" for value in (one.mota, one.idf1, one.keep, one.wrong))
            cells = (one.sequence, name, *values, str(one.idsw), f"{one.ms:.2f}")
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


@app.command()
def main(
    write: Annotated[Path | None, typer.Option(help="file whose table is replaced")] = None,
) -> None:
    """Track the given boxes of every sequence and score them beside the public trackers."""
    ours: list[BaselineScores] = []
    claims: dict[str, list[Claim]] = {}
    for folder in sequences():
        scores, claims[folder.name] = measure(folder, read_given(folder), folder.name)
        ours.append(scores)
        if folder.name == TRUE_BOXES:
            perfect, _ = measure(folder, true_boxes(folder), f"{folder.name} (true boxes)")
            ours.append(perfect)
    text = f"{table(ours)}\n{reliability_table(claims)}"
    typer.echo(text)
    if write is not None:
        write.write_text(replace_between(write.read_text("utf-8"), text), encoding="utf-8")


if __name__ == "__main__":
    run_app(app)
