"""Figures on footage that nobody tuned on: every recording played as other footage.

Wrong% of a short recording is often one choice of one id, so that a figure as shot is mostly luck.
What is left of it where everybody is chosen once a box is on nobody else stands beside it.
Here a recording is played mirrored, backwards in time, both, from later on, every second frame,
smaller, darker and with noise (`benchmarks.variant_sequences`), its ground truth alike, through one
default: own evidence, networks, and where there is a file of boxes, those and the true ones.
Backwards is honest footage: walking people are people, whichever way they go. Variants of one
recording show the same people in the same clothes: they tell luck from skill, and are no
substitute for another street.

A recording is detected once per variant; trackers that lack a mechanism (`benchmarks.mechanisms`)
are replayed its messages, so that what helps the recordings as shot alone can be told.

Example run: python -m benchmarks.variants --model yolox_nano.onnx --model person_yolox_192.onnx \
--write docs/records/results.md
"""

from __future__ import annotations

import os
import statistics
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import cv2
import typer

from benchmarks.association import sequences, true_boxes
from benchmarks.common import NAMED_NETWORKS, Recordings, Write, publish, recordings
from benchmarks.mechanisms import OFF, inputs, tracked_boxes, without
from benchmarks.variant_sequences import AS_SHOT, VARIANTS, has_pictures, write_variant
from heel.evaluation.sequence_scores import SequenceScores
from heel.schemas.errors import SettingsError
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
MOST_FRAMES = 200
"""Frames of a recording with pictures that are played, for time; chosen by hand."""
_WHOLE = 10_000_000
_COLUMNS = ("keep", "wrong", "idf1", "mota", "wrong_apart")
_HEADS = ("keep%", "wrong%", "IDF1", "MOTA", "wrong%, chosen apart")
_GOAL_WRONG, _GOAL_KEEP = 1.5, 80.0
"""What footage is to reach [percent]."""

Values = tuple[float, ...]
"""Of `_COLUMNS` [percent]."""
Played = dict[str, dict[str, Values]]
"""By recording and input, and by variant."""


def scored(
    folder: Path, models: Sequence[Path], moves_boxes: bool
) -> dict[str, Callable[[], SequenceScores]]:
    """What is scored of a sequence folder, by name of recording and input."""
    found = inputs([str(folder)], models, False) if has_pictures(folder) else {}
    if moves_boxes and (folder / "det").is_dir():
        found[f"{folder.name}, boxes of the file"] = partial(tracked_boxes, folder)
        found[f"{folder.name}, true boxes"] = partial(tracked_boxes, folder, true_boxes(folder))
    return found


def play(
    recording: Path, names: Sequence[str], models: Sequence[Path], mechanisms: Sequence[str],
    most_frames: int,
) -> dict[str, Played]:  # fmt: skip
    """Play a recording as all variants; by mechanism left out, "" for none."""
    played: dict[str, Played] = {}
    pictures = has_pictures(recording)
    for name in names:
        variant = VARIANTS[name]
        if not (pictures or variant.moves_boxes):
            continue
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch) / recording.name
            write_variant(recording, variant, folder, most_frames if pictures else _WHOLE)
            found = scored(folder, models, variant.moves_boxes)
            for mechanism in ("", *mechanisms):
                with without(mechanism):
                    for on, score in found.items():
                        scores = score()
                        values = tuple(float(getattr(scores, column)) for column in _COLUMNS)
                        played.setdefault(mechanism, {}).setdefault(on, {})[name] = values
                        shown = " ".join(f"{value:.1f}" for value in values)
                        line = ", ".join(filter(None, (on, name, mechanism)))
                        typer.echo(f"{line}: {shown}", err=True)
    return played


def table(played: Played) -> str:
    """A row for each recording and input: as shot, median and worst of the variants."""
    lines = ["| recording | input | " + " | ".join(_HEADS) + " |", "|" + "---|" * 7]
    for on, variants in played.items():
        cells = []
        for k, column in enumerate(_COLUMNS):
            values = [each[k] for each in variants.values()]
            worst = max(values) if column.startswith("wrong") else min(values)
            shot = f"{variants[AS_SHOT][k]:.1f}" if AS_SHOT in variants else "-"
            cells.append(f"{shot}, {statistics.median(values):.1f}, {worst:.1f}")
        lines.append("| " + " | ".join((*on.split(", ", 1), *cells)) + " |")
    return "\n".join(lines) + "\n"


def by_input(played: Played) -> dict[str, list[Values]]:
    """All variants of all recordings, by input; recordings have as many each, but for boxes."""
    found: dict[str, list[Values]] = {}
    for on, variants in played.items():
        found.setdefault(on.split(", ", 1)[1], []).extend(variants.values())
    return found


def means(played: Played) -> str:
    """A row for each input: means over all recordings and variants, and how many miss the goal."""
    lines = ["| input | plays | " + " | ".join(_HEADS) + " | wrong% above 1.5 | keep% below 80 |",
             "|" + "---|" * 9]  # fmt: skip
    for name, plays in by_input(played).items():
        cells = [f"{value:.1f}" for value in _mean(plays)]
        wrong = sum(each[1] > _GOAL_WRONG for each in plays)
        lost = sum(each[0] < _GOAL_KEEP for each in plays)
        lines.append(f"| {name} | {len(plays)} | " + " | ".join(cells) + f" | {wrong} | {lost} |")
    return "\n".join(lines) + "\n"


def differences(played: Mapping[str, Played]) -> str:
    """A row for each mechanism and input: what leaving it out changes in the means."""
    lines = ["| without | input | " + " | ".join(_HEADS) + " | as shot | plays better, worse |",
             "|" + "---|" * 9]  # fmt: skip
    for mechanism, without_it in played.items():
        if not mechanism:
            continue
        for name, plays in by_input(without_it).items():
            usual = by_input(played[""])[name]
            pairs = list(zip(plays, usual, strict=True))
            change = [
                f"{new - old:+.1f}" for new, old in zip(_mean(plays), _mean(usual), strict=True)
            ]
            gains = [_worth(new) - _worth(old) for new, old in pairs]
            shot = [
                _worth(without_it[on][AS_SHOT]) - _worth(played[""][on][AS_SHOT])
                for on in without_it
                if on.endswith(f", {name}") and AS_SHOT in without_it[on]
            ]
            counts = f"{sum(g > 0.05 for g in gains)}, {sum(g < -0.05 for g in gains)}"
            cells = (mechanism, name, *change, f"{sum(shot) / max(len(shot), 1):+.1f}", counts)
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _worth(values: Values) -> float:
    """Keep% less wrong%: what a follower lives by."""
    return values[0] - values[1]


def _mean(plays: Sequence[Values]) -> list[float]:
    return [statistics.fmean(column) for column in zip(*plays, strict=True)]


def chosen(variants: Sequence[str] | None) -> list[str]:
    """The variants asked for, or all.

    Raises:
        SettingsError: there is none of such a name.
    """
    for name in variants or ():
        if name not in VARIANTS:
            raise SettingsError(f"--variant {name}: give one of {', '.join(VARIANTS)}")
    return list(variants or VARIANTS)


@app.command()
def main(
    write: Write = None,
    recording: Recordings = None,
    model: Annotated[list[Path] | None, typer.Option(help="network too; repeatable")] = None,
    variant: Annotated[list[str] | None, typer.Option(help="only this one; repeatable")] = None,
    without_: Annotated[
        list[str] | None,
        typer.Option("--without", help=f"also without this mechanism; of {', '.join(OFF)}"),
    ] = None,
    frames: Annotated[
        int, typer.Option(min=20, help="most frames of a recording with pictures")
    ] = MOST_FRAMES,
) -> None:
    """Score recordings as shot and as other footage."""
    os.environ.update(NAMED_NETWORKS)
    cv2.setNumThreads(1)
    names = chosen(variant)
    sources = [Path(source) for source in recordings(recording)]
    if not recording:
        sources += [folder for folder in sequences() if not has_pictures(folder)]
    played: dict[str, Played] = {}
    for source in sources:
        for mechanism, found in play(source, names, model or (), without_ or (), frames).items():
            played.setdefault(mechanism, {}).update(found)
    text = "\n".join([means(played[""]), table(played[""])])
    publish(text + ("\n" + differences(played) if without_ else ""), write, "variants")


if __name__ == "__main__":
    run_app(app)
