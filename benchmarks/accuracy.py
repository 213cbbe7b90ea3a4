"""Both presets on every static recording, scored: prints the table of docs/records/results.md.

Protocol: every frame from the first, online, IoU 0.5, MOT15 ground truth with flag-0 rows left
out, one setting for all recordings. Beside it stand the paper's claim and the best public figures.

Example run: python -m benchmarks.accuracy --write docs/records/results.md
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.common import (
    Figure,
    Json,
    Write,
    heel_run,
    name_of,
    publish,
    recordings,
    write_json,
)
from heel.evaluation.sequence_scores import SequenceScores, evaluate
from heel.services.pipeline import scene_truth
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
PRESETS = ("default", "paper")
_COLUMNS = ("keep", "wrong", "mota", "motp", "idf1", "hota", "idsw", "fp", "fn", "boxes", "dice")


def measure(
    recording: str, preset: str = "default", settings: str = ""
) -> tuple[SequenceScores, float]:
    """Scores of one recording, and milliseconds a frame of the whole chain in one process.

    Args:
        recording: a source of `heel run`.
        preset: of detector and tracker.
        settings: text of a settings file.
    """
    with tempfile.TemporaryDirectory() as out:
        config = Path(out) / "settings.toml"
        config.write_text(settings, encoding="utf-8")
        flags = ("--in-process", "--preset", preset, "--config", str(config))
        summary = heel_run(recording, Path(out), *flags)
        scores = evaluate(truth_of(recording, Path(out)), Path(out))
    scores = scores.model_copy(update={"sequence": name_of(recording)})
    return scores, 1e3 * float(summary["wall_s"]) / max(1, int(summary["frames"]["tracked"]))


def truth_of(source: str, folder: Path) -> Path:
    """Ground truth of a recording, or of a drawn scene (written into `folder`)."""
    if not source.startswith("scene:"):
        return Path(source)
    truth = folder / "gt.txt"
    truth.write_text("".join(scene_truth(source).rows), encoding="ascii")
    return truth


def row(preset: str, scores: SequenceScores, milliseconds: float) -> str:
    """One line of the Markdown table."""
    values = (getattr(scores, column) for column in _COLUMNS)
    cells = [f"{value:.1f}" if isinstance(value, float) else str(value) for value in values]
    return "| " + " | ".join((scores.sequence, preset, *cells, f"{milliseconds:.1f}")) + " |"


def table(measured: list[tuple[str, SequenceScores, float]]) -> str:
    """The Markdown table of all measurements."""
    head = ("sequence", "preset", "keep%", "wrong%", "MOTA", "MOTP", "IDF1", "HOTA", "IDsw", "FP",
            "FN", "boxes", "Dice", "ms/frame")  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + [row(*entry) for entry in measured]) + "\n"


@app.command()
def main(
    write: Write = None,
    recording: Annotated[list[str] | None, typer.Option(help="score these sources instead")] = None,
    json: Json = None,
) -> None:
    """Score both presets on all static recordings."""
    measured = []
    figures = []
    for source in recordings(recording):
        for preset in PRESETS:
            scores, milliseconds = measure(source, preset)
            measured.append((preset, scores, milliseconds))
            typer.echo(row(preset, scores, milliseconds), err=True)
            name = f"accuracy/{name_of(source)}/{preset}"
            figures += [
                Figure(f"{name}/{column}", float(getattr(scores, column)), "%", "", None, 1)
                for column in ("mota", "motp", "idf1", "keep", "wrong")
            ]
    text = table(measured)
    publish(text, write)
    write_json(figures, json)


if __name__ == "__main__":
    run_app(app)
