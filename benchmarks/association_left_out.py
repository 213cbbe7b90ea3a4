"""Settings of association chosen without the sequence they are reported on (leave-one-out).

For every sequence, the setting that does best on all the others is taken, and its scores on the
sequence that was left out are printed. Best: the highest mean of IDF1 + keep% - 4 wrong%, since a
wrong person is worse than none. The table also tells how far the scores of the defaults, which were
chosen with all sequences in view, may be trusted elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

from benchmarks.association_peers import frame_count
from heel.evaluation.alignment import align
from heel.evaluation.motchallenge import read_ground_truth
from heel.evaluation.sequence_scores import SequenceScores, score_sequence
from heel.services.commands.track_detections import read_given, shown_rows
from heel.services.tracker.boxes.sequence import track_sequence
from heel.services.tracker.people.tuning import FILE, Tuning

GRID = {"rivals": (0.05, 0.1, 0.2, 1.0), "forget_s": (0.4, 0.7)}
_WRONG_WEIGHS = 4.0

Setting = tuple[float, ...]
"""Values of the fields of `Tuning` in `GRID`, in their order."""


def tuning_of(setting: Setting) -> Tuning:
    """The usual numbers but for one point of the grid."""
    return replace(FILE, **dict(zip(GRID, setting, strict=True)))


def scores_on(folder: Path, setting: Setting) -> SequenceScores:
    """Scores of one sequence with one setting."""
    given = read_given(folder)
    rows = shown_rows(track_sequence(given, tuning_of(setting)))
    truth = read_ground_truth(folder / "gt" / "gt.txt")
    return score_sequence(align(truth, rows, name=folder.name, frame_count=frame_count(given)))


def value(scores: SequenceScores) -> float:
    """What a setting is worth on a sequence."""
    return scores.idf1 + scores.keep - _WRONG_WEIGHS * scores.wrong


def chosen_without(name: str, found: dict[Setting, dict[str, SequenceScores]]) -> Setting:
    """The setting that does best on every sequence but `name`; the first of equals."""
    return max(
        found,
        key=lambda setting: sum(
            value(scores) for other, scores in found[setting].items() if other != name
        ),
    )


def left_out_table(folders: Sequence[Path]) -> str:
    """Markdown: per sequence, what the others chose and how it does there."""
    found = {
        setting: {folder.name: scores_on(folder, setting) for folder in folders}
        for setting in product(*GRID.values())
    }
    head = ("left out", *GRID, "MOTA", "IDF1", "keep%", "wrong%")
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for name in (folder.name for folder in folders):
        setting = chosen_without(name, found)
        scores = found[setting][name]
        values = (scores.mota, scores.idf1, scores.keep, scores.wrong)
        cells = (*(f"{one:g}" for one in setting), *(f"{one:.1f}" for one in values))
        lines.append("| " + " | ".join((name, *cells)) + " |")
    return "\n".join(lines) + "\n"
