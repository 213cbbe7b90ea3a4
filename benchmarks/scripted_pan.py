"""A window that moves over PETS09-S2L1 by a script: its table of docs/records/moving-camera.md.

The window is all that detector and tracker see. It goes after one person by the ground truth, or
from border to border; the protocol is that of `services/loops/panning/scripted.py`. `mixture`,
whose background stands still, is the comparison. Every run but the comparison's has other noise
several times over: how a scene's scale is learned hangs on details.

Example run: python -m benchmarks.scripted_pan --write docs/records/moving-camera.md
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer

from benchmarks.common import Figure, Json, Write, data_folder, publish, write_json
from heel.schemas.errors import HeelError
from heel.services.detector.settings import DetectorSettings
from heel.services.loops.panning.perception import Pixels
from heel.services.loops.panning.scripted import Played, Script, following, panning, play
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
SEQUENCE, WINDOW = "PETS09-S2L1", (384, 288)
SCRIPTS: dict[str, Script] = {"follows a person": following, "pans": panning}
COMPARISON = "mixture"
SEEDS = (3, 4, 5, 6)
HEAD = ("window", "px/frame", "detector", "runs", "MOTA", "worst", "IDF1", "IDsw", "FP", "FN",
        "boxes", "keep%", "wrong%")  # fmt: skip


def row(script: str, detector: str, runs: Sequence[Played]) -> str:
    """One line of the Markdown table: means over the runs, and the worst MOTA."""
    shifts = np.concatenate([one.shifts_px for one in runs])
    moved = f"{shifts.mean():.1f}, at most {shifts.max():.1f}"
    means = {
        what: sum(getattr(one.scores, what) for one in runs) / len(runs)
        for what in ("mota", "idf1", "idsw", "fp", "fn", "boxes", "keep", "wrong")
    }
    worst = min(one.scores.mota for one in runs)
    cells = [f"{means['mota']:.1f}", f"{worst:.1f}", f"{means['idf1']:.1f}"]
    cells += [f"{means[what]:.0f}" for what in ("idsw", "fp", "fn", "boxes")]
    cells += [f"{means[what]:.1f}" for what in ("keep", "wrong")]
    return "| " + " | ".join([script, moved, detector, str(len(runs)), *cells]) + " |"


def measure(sequence: Path, detectors: Sequence[str]) -> tuple[list[str], list[Figure]]:
    """Rows of the table, and the MOTA of each as a figure."""
    rows, figures = [], []
    for script, path in SCRIPTS.items():
        for detector in detectors:
            seeds = SEEDS[:1] if detector == COMPARISON else SEEDS
            runs = [
                play(sequence, WINDOW, path, Pixels(DetectorSettings(detector=detector)), seed)
                for seed in seeds
            ]
            rows.append(row(script, detector, runs))
            typer.echo(rows[-1], err=True)
            mota = sum(one.scores.mota for one in runs) / len(runs)
            name = f"scripted-pan/{script}/{detector}/mota"
            figures.append(Figure(name, mota, "%", "", None, len(runs)))
    return rows, figures


@app.command()
def main(
    detector: Annotated[list[str] | None, typer.Option(help="instead of ego, mixture")] = None,
    write: Write = None,
    json: Json = None,
) -> None:
    """Score detectors, with the tracker behind them, on a scripted window."""
    sequence = data_folder() / SEQUENCE
    if not sequence.is_dir():
        raise HeelError(f"{sequence}: no such recording: set HEEL_DATA to the folder that has it")
    cv2.setNumThreads(1)
    rows, figures = measure(sequence, detector or ("ego", COMPARISON))
    head = ["| " + " | ".join(HEAD) + " |", "|" + "---|" * len(HEAD)]
    publish("\n".join([*head, *rows]) + "\n", write, "scripted pan")
    write_json(figures, json)


if __name__ == "__main__":
    run_app(app)
