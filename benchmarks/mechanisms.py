"""What each mechanism of the tracker adds: recordings without it, beside the tracker as it is.

A recording is detected once, with the feedback of the tracker as it is; its messages are then
replayed to trackers that lack one mechanism each. So a row takes seconds; what the detector would
have seen by other feedback is left out. Boxes of files are tracked as in `benchmarks.association`.
A row shows the difference to the tracker as it is, where one of the four is at least 0.05.

Example run: python -m benchmarks.mechanisms --model yolox_nano.onnx --write docs/records/results.md
"""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any
from unittest.mock import patch

import cv2
import typer

from benchmarks.association import sequences
from benchmarks.association_peers import frame_count
from benchmarks.common import NAMED_NETWORKS, Recordings, Write, name_of, publish, recordings
from heel.evaluation.alignment import align
from heel.evaluation.motchallenge import read_ground_truth
from heel.evaluation.sequence_scores import SequenceScores, evaluate, score_sequence
from heel.schemas import Blobs
from heel.services.commands.track_detections import read_given, shown_rows
from heel.services.detector.settings import DetectorServiceSettings
from heel.services.pipeline import InProcessPipeline, RecordedFrames
from heel.services.run.outputs import RunOutputs
from heel.services.run.summary import RunSummary
from heel.services.runtime.command_line import run_app
from heel.services.runtime.settings import load_settings
from heel.services.tracker.boxes.sequence import GivenSequence, track_sequence
from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
_TRACKER = "heel.services.tracker."
_COLUMNS = ("keep", "wrong", "idf1", "mota")
_LEAST = 0.05
"""Difference that is shown [percent]: what is rounded to nothing is not."""


def _nothing(*_: object) -> None:
    """In place of what acts."""


def _nobody(*_: object) -> list[Any]:
    """In place of what finds."""
    return []


_PEOPLE, _BOXES, _EVIDENCE = (_TRACKER + part for part in ("people.", "boxes.", "evidence."))
Off = Sequence[tuple[str, str, Any]]
"""Module (and class), attribute, and what stands in its place."""
OFF: dict[str, Off] = {
    "contacts": [(f"{_PEOPLE}contacts.Contacts", "touch", _nothing)],
    "verification of newcomers": [
        (f"{_PEOPLE}verification.Verifications", "note_newcomers", _nothing)
    ],
    "comparison at a return": [(f"{_PEOPLE}identity.Identity", "back", lambda *_: 1.0)],
    "re-identification": [(f"{_PEOPLE}recall.Recall", "recognised", _nobody)],
    "camera guessed from boxes": [
        (f"{_PEOPLE}camera_motion.CameraMotion", "learn", _nothing)
    ],
    "reach of a return": [(f"{_PEOPLE}memory", "_out_of_reach", lambda *_: False)],
    "second look at newcomers": [(f"{_PEOPLE}recall", "_asks_again", lambda *_: False)],
    "several views of a person": [(f"{_PEOPLE}looks", "_MOST_VIEWS", 1)],
    "look model learned": [(f"{_PEOPLE}looks.LookStatistics", "learn", _nothing)],
    "give-up of doubtful ids": [(f"{_PEOPLE}tracker", "_GIVE_UP", -1.0)],
    "one box around two": [(f"{_BOXES}front_end", "merge_candidates", _nobody)],
    "wider noise at the side": [(f"{_BOXES}front_end", "_CUT_NOISE", 1.0)],
    "walkers by lower scores": [(f"{_PEOPLE}tracker", "_WALK", math.inf)],
    "parted from a newcomer": [(f"{_EVIDENCE}front_end.EvidenceFrontEnd", "parted", _nobody)],
    "doubles left out": [
        (f"{_EVIDENCE}front_end", "without_duplicates", lambda people, *_: list(people))
    ],
    "found again beside": [(f"{_EVIDENCE}front_end", "missed_near", _nothing)],
    "ghosts of the start": [(f"{_EVIDENCE}front_end", "EARLY_S", -1.0)],
    "runs refute a line": [(f"{_EVIDENCE}runs.Runs", "overlong", lambda *_: 0.0)],
    "heights measured": [(f"{_EVIDENCE}front_end", "measure_height", _nothing)],
}  # fmt: skip
"""How each mechanism is switched off."""


def without(name: str) -> ExitStack:
    """A context in which a mechanism is off; "" for none."""
    stack = ExitStack()
    for owner, attribute, instead in OFF[name] if name else ():
        module, _, last = owner.rpartition(".")
        found = getattr(import_module(module), last) if last[0].isupper() else import_module(owner)
        stack.enter_context(patch.object(found, attribute, instead))
    return stack


def detected(recording: str, model: Path | None) -> list[Blobs]:
    """A detector's messages of a recording, every frame, with the feedback of the tracker."""
    flags = {"detector": {"model": "none" if model is None else str(model)}}
    detector = load_settings("detector", DetectorServiceSettings, flags, None)
    pipeline = InProcessPipeline(detector.service, TrackerSettings())
    with RecordedFrames(recording) as frames:
        return [pipeline.step(frame, image, size)[0] for frame, image, size in frames]


def replayed(recording: str, messages: Sequence[Blobs]) -> SequenceScores:
    """Scores of a fresh tracker on the messages of a recording."""
    tracker = Tracker(TrackerSettings())
    with tempfile.TemporaryDirectory() as folder:
        with RunOutputs(Path(folder), RunSummary(mode="in-process"), False) as outputs:
            for blobs in messages:
                outputs.tracks(tracker.update(blobs))
        return evaluate(Path(recording), Path(folder))


def tracked_boxes(folder: Path, boxes: GivenSequence | None = None) -> SequenceScores:
    """Scores of the boxes of a sequence's file, or of other boxes for it."""
    given, truth = boxes or read_given(folder), read_ground_truth(folder / "gt" / "gt.txt")
    shown = shown_rows(list(track_sequence(given)))
    return score_sequence(align(truth, shown, name=folder.name, frame_count=frame_count(given)))


def inputs(
    chosen: Sequence[str] | None, models: Sequence[Path], boxes: bool
) -> dict[str, Callable[[], SequenceScores]]:
    """What is scored, by name."""
    found: dict[str, Callable[[], SequenceScores]] = {}
    for recording in recordings(chosen):
        for model in (None, *models):
            messages = detected(recording, model)
            name = f"{name_of(recording)}, {'own evidence' if model is None else model.stem}"
            found[name] = partial(replayed, recording, messages)
    for folder in sequences() if boxes else ():
        found[f"{folder.name}, boxes of the file"] = partial(tracked_boxes, folder)
    return found


@app.command()
def main(
    write: Write = None,
    recording: Recordings = None,
    model: Annotated[list[Path] | None, typer.Option(help="network too; repeatable")] = None,
    mechanism: Annotated[list[str] | None, typer.Option(help="only this one; repeatable")] = None,
    boxes: Annotated[bool, typer.Option(help="boxes of files, too")] = True,
) -> None:
    """Score the tracker as it is, and without each of its mechanisms."""
    os.environ.update(NAMED_NETWORKS)
    cv2.setNumThreads(1)
    lines = ["| without | on | keep% | wrong% | IDF1 | MOTA |", "|" + "---|" * 6]
    scored = inputs(recording, model or (), boxes)
    usual: dict[str, list[float]] = {}
    for name in ("", *(mechanism or OFF)):
        same = 0
        with without(name):
            for on, score in scored.items():
                scores = score()
                values = [float(getattr(scores, column)) for column in _COLUMNS]
                if not name:
                    usual[on] = values
                    cells = [f"{value:.1f}" for value in values]
                else:
                    change = [new - old for new, old in zip(values, usual[on], strict=True)]
                    if max(map(abs, change)) < _LEAST:
                        same += 1
                        continue
                    cells = [f"{value:+.1f}" for value in change]
                lines.append("| " + " | ".join((name or "nothing", on, *cells)) + " |")
                typer.echo(lines[-1], err=True)
        if same:
            lines.append(f"| {name} | {same} others | the same | | | |")
    publish("\n".join(lines) + "\n", write, "mechanisms")


if __name__ == "__main__":
    run_app(app)
