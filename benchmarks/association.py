"""The tracker on given boxes beside four public trackers: tables of docs/records/association.md.

Protocol: boxes of det.txt, every frame from the first, online, IoU 0.5, MOT15 ground truth with
flag-0 rows left out, one setting for all sequences, no pictures. CPU time is the median of runs in
which the trackers take turns.

Example run: make peers (without the public trackers: python -m benchmarks.association)
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import typer

from benchmarks.association_calibration import Claim, claims_of, reliability_table
from benchmarks.association_left_out import left_out_table
from benchmarks.association_peers import Tracker, frame_count, peers, peers_note
from benchmarks.common import Write, data_folder, interleaved, median, publish
from heel.evaluation.alignment import align
from heel.evaluation.motchallenge import read_ground_truth
from heel.evaluation.rows import BoxRows
from heel.evaluation.sequence_scores import SequenceScores, score_sequence
from heel.schemas.errors import HeelError
from heel.services.commands.track_detections import read_given, shown_rows
from heel.services.runtime.command_line import run_app
from heel.services.tracker.boxes.sequence import GivenSequence, track_sequence

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
OURS = "Heel"
TRUE_BOXES = "PETS09-S2L1"
_RUNS = 3


@dataclass(frozen=True)
class Measured:
    """One tracker on one sequence: its boxes, their scores, and CPU milliseconds a frame."""

    tracker: str
    rows: BoxRows
    scores: SequenceScores
    milliseconds: float


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


def heel(given: GivenSequence) -> tuple[BoxRows, float]:
    """Heel's tracker on a sequence: the boxes it shows, and CPU seconds."""
    started_s = time.process_time()
    tracked = list(track_sequence(given))
    cpu_s = time.process_time() - started_s
    return shown_rows(tracked), cpu_s


def measure(folder: Path, given: GivenSequence, name: str) -> list[Measured]:
    """All trackers on one sequence in turns, ours first; every run has to show the same boxes.

    Raises:
        HeelError: a tracker showed other boxes in another run.
    """
    trackers: dict[str, Tracker] = {OURS: heel, **peers()}
    shown: dict[str, BoxRows] = {}

    def run(tracker: str) -> float:
        rows, cpu_s = trackers[tracker](given)
        if not _equal(shown.setdefault(tracker, rows), rows):
            raise HeelError(f"{tracker} on {name} shows other boxes in every run: seed it")
        return cpu_s

    seconds = interleaved(_RUNS, *(partial(run, tracker) for tracker in trackers))
    truth = read_ground_truth(folder / "gt" / "gt.txt")
    count = frame_count(given)
    return [
        Measured(
            tracker,
            shown[tracker],
            score_sequence(align(truth, shown[tracker], name=name, frame_count=count)),
            1e3 * median(taken) / count,
        )
        for tracker, taken in zip(trackers, seconds, strict=True)
    ]


def _equal(one: BoxRows, other: BoxRows) -> bool:
    same_ids = np.array_equal(one.identities, other.identities)
    return same_ids and np.array_equal(one.boxes_xyxy, other.boxes_xyxy)


def table(measured: list[Measured]) -> str:
    """The Markdown table, in the order given."""
    head = ("sequence", "tracker", "MOTA", "IDF1", "keep%", "wrong%", "IDsw", "ms/frame")
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for one in measured:
        scores = one.scores
        tracker = f"**{one.tracker}**" if one.tracker == OURS else one.tracker
        values = (scores.mota, scores.idf1, scores.keep, scores.wrong)
        percent = (f"{value:.1f}" for value in values)
        cells = (scores.sequence, tracker, *percent, f"{scores.idsw}", f"{one.milliseconds:.2f}")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


@app.command()
def main(
    write: Write = None,
) -> None:
    """Track the given boxes of every sequence and score them beside the public trackers."""
    measured: list[Measured] = []
    claims: dict[str, list[Claim]] = {}
    for folder in sequences():
        found = measure(folder, read_given(folder), folder.name)
        claims[folder.name] = claims_of(read_ground_truth(folder / "gt" / "gt.txt"), found[0].rows)
        if folder.name == TRUE_BOXES:
            found += measure(folder, true_boxes(folder), f"{folder.name} (true boxes)")
        measured += found
    parts = (table(measured), peers_note(), reliability_table(claims), left_out_table(sequences()))
    text = "\n".join(parts)
    publish(text, write)


if __name__ == "__main__":
    run_app(app)
