"""Cameras that move, and a network that sees people: the tables of docs/records/moving-camera.md.

Every frame from the first, online, one setting for all recordings. One person: an identity is
chosen in the first frame in which a shown box is on the target, and held, as
`evaluation/single_target.py` says.
Several: IoU 0.5 against MOT15 ground truth, rows of flag 0 left out or ignored.

Example run: python -m benchmarks.moving_camera --model yolox_nano.onnx --sequence Couple
"""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.common import Figure, Json, Write, data_folder, heel_run, publish, write_json
from heel.evaluation.motchallenge import read_ground_truth, read_tracks
from heel.evaluation.sequence_scores import evaluate
from heel.evaluation.single_target import SingleTargetScores, single_target_scores
from heel.schemas.errors import HeelError
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
ONE_PERSON = ("Couple", "Crossing", "Human3-first199", "UAV-person11")
SEVERAL = ("Jogging", "PETS09-S2L1")
_HEAD_ONE = ("sequence", "detector", "frames", "on target%", "elsewhere%", "success AUC",
             "precision 20 px", "ms/frame")  # fmt: skip
_HEAD_SEVERAL = ("sequence", "detector", "flag 0", "MOTA", "IDF1", "IDsw", "FP", "FN", "keep%",
                 "wrong%", "ms/frame")  # fmt: skip
Ways = Sequence[tuple[str, tuple[str, ...]]]
"""What a table calls a detector, and its flags."""


def single_rows(ways: Ways, chosen: Collection[str]) -> tuple[list[str], list[Figure]]:
    """Table rows of the chosen recordings of one person, their means, and these as figures."""
    rows, figures = [], []
    sequences = [sequence for sequence in ONE_PERSON if sequence in chosen]
    for name, flags in ways if sequences else ():
        scores = []
        for sequence in sequences:
            with tempfile.TemporaryDirectory() as out:
                milliseconds = _played(sequence, Path(out), flags)
                truth = read_ground_truth(data_folder() / sequence / "gt" / "gt.txt")
                one = single_target_scores(truth, read_tracks(Path(out) / "tracks.txt"))
            scores.append(one)
            rows.append(_row(sequence, name, str(one.frames), *_shares(one), f"{milliseconds:.1f}"))
            typer.echo(rows[-1], err=True)
        means = [sum(values) / len(scores) for values in zip(*map(_numbers, scores), strict=True)]
        rows.append(_row("mean", name, "", *(f"{value:.1f}" for value in means), ""))
        figures += [
            Figure(f"moving-camera/mean/{name}/{what}", value, "%", "", None, 1)
            for what, value in zip(("on-target", "elsewhere"), means, strict=False)
        ]
    return rows, figures


def several_rows(ways: Ways, chosen: Collection[str]) -> tuple[list[str], list[Figure]]:
    """Table rows of the chosen recordings of several people, and MOTA and IDF1 as figures."""
    rows, figures = [], []
    for sequence in (one for one in SEVERAL if one in chosen):
        for name, flags in ways:
            with tempfile.TemporaryDirectory() as out:
                milliseconds = _played(sequence, Path(out), flags)
                mot15 = evaluate(data_folder() / sequence, Path(out))
                ignoring = evaluate(data_folder() / sequence, Path(out), flags="ignore")
            for rule, scores in (("left out", mot15), ("ignored", ignoring)):
                if rule == "ignored" and ignoring == mot15:
                    continue
                values = (scores.mota, scores.idf1, scores.idsw, scores.fp, scores.fn, scores.keep,
                          scores.wrong)  # fmt: skip
                cells = (f"{v:.1f}" if isinstance(v, float) else str(v) for v in values)
                rows.append(_row(sequence, name, rule, *cells, f"{milliseconds:.1f}"))
                typer.echo(rows[-1], err=True)
            figures += [
                Figure(f"moving-camera/{sequence}/{name}/{what}", value, "%", "", None, 1)
                for what, value in (("mota", mot15.mota), ("idf1", mot15.idf1))
            ]
    return rows, figures


def table(head: Sequence[str], rows: Sequence[str]) -> str:
    """A Markdown table."""
    return "\n".join([_row(*head), "|" + "---|" * len(head), *rows]) + "\n"


def _played(sequence: str, out: Path, flags: Sequence[str]) -> float:
    """Run a recording through the cores; milliseconds a frame of the whole chain."""
    summary = heel_run(str(data_folder() / sequence), out, "--in-process", *flags)
    return 1e3 * float(summary["wall_s"]) / max(1, int(summary["frames"]["tracked"]))


def _row(*cells: str) -> str:
    return "| " + " | ".join(cells) + " |"


def _numbers(one: SingleTargetScores) -> tuple[float, float, float, float]:
    return one.on_target, one.elsewhere, one.success_auc, one.precision


def _shares(one: SingleTargetScores) -> list[str]:
    return [f"{value:.1f}" for value in _numbers(one)]


@app.command()
def main(
    model: Annotated[Path | None, typer.Option(help="ONNX network that finds people")] = None,
    sequence: Annotated[list[str] | None, typer.Option(help="only this one; repeatable")] = None,
    write: Write = None,
    json: Json = None,
) -> None:
    """Score the detectors on moving cameras, with a network where one is given."""
    known = (*ONE_PERSON, *SEVERAL)
    chosen = sequence or known
    if unknown := sorted(set(chosen) - set(known)):
        raise HeelError(f"sequence {unknown[0]}: not one of {', '.join(known)}")
    seeing: Ways = [("auto, model", ("--model", str(model)))] if model is not None else []
    one, figures = single_rows([*seeing, ("auto", ())], chosen)
    several, more = several_rows([*seeing, ("ego", ("--detector", "ego"))], chosen)
    tables = ((_HEAD_ONE, one), (_HEAD_SEVERAL, several))
    text = "\n".join(table(head, rows) for head, rows in tables if rows)
    publish(text, write)
    write_json([*figures, *more], json)


if __name__ == "__main__":
    run_app(app)
