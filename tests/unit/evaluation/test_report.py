"""From files to one object per sequence, a table and JSON."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError
from rich.console import Console

from heel.evaluation.sequence_scores import (
    SequenceScores,
    evaluate,
    find_pairs,
    load_sequence,
    scores_json,
    scores_table,
)
from heel.schemas.errors import HeelError

Rows = NDArray[np.float64]
Draw = Callable[[int], tuple[Rows, Rows]]

FIELDS = ["sequence", "mota", "motp", "idf1", "hota", "idsw", "fp", "fn", "boxes"]
FIELDS += ["keep", "wrong", "dice", "wrong_apart"]


def save(path: Path, rows: Rows) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, rows, delimiter=",", fmt="%.6g")
    return path


@pytest.fixture
def recorded(draw_sequence: Draw, tmp_path: Path) -> tuple[Path, Path]:
    """A sequence directory named ``walk`` and a tracks file."""
    truth, tracks = draw_sequence(0)
    save(tmp_path / "walk" / "gt" / "gt.txt", truth)
    return tmp_path / "walk", save(tmp_path / "out" / "tracks.txt", tracks)


@pytest.mark.parametrize("gt", ["", "gt/gt.txt"])
@pytest.mark.parametrize("tracks", ["tracks.txt", "."])
def test_directory_or_file_is_the_same(recorded: tuple[Path, Path], gt: str, tracks: str) -> None:
    folder, file = recorded
    assert evaluate(folder / gt, file.parent / tracks) == evaluate(folder, file)


def test_lone_ground_truth_file_names_its_sequence(recorded: tuple[Path, Path]) -> None:
    folder, tracks = recorded
    lone = (folder / "gt" / "gt.txt").rename(folder / "corridor.txt")
    assert evaluate(lone, tracks).sequence == "corridor"


def test_sequence_info_gives_name_and_length(recorded: tuple[Path, Path]) -> None:
    folder, tracks = recorded
    (folder / "seqinfo.ini").write_text("[Sequence]\nname=long-walk\nseqLength=500\n")
    sequence = load_sequence(folder, tracks)
    assert (sequence.name, sequence.frame_count) == ("long-walk", 500)
    assert evaluate(folder, tracks).sequence == "long-walk"


def test_empty_tracks_file_is_scored_as_nobody_shown(recorded: tuple[Path, Path]) -> None:
    folder, tracks = recorded
    tracks.write_text("")
    scores = evaluate(folder, tracks)
    assert scores.fn == scores.boxes > 0
    assert (scores.mota, scores.keep, scores.wrong, scores.dice) == (0, 0, 0, 0)


def test_identity_that_is_only_in_the_ground_truth_is_missed(tmp_path: Path) -> None:
    truth = np.array([[1, 1, 10, 10, 20, 40, 1], [1, 2, 90, 10, 20, 40, 1]])
    scores = evaluate(save(tmp_path / "gt.txt", truth), save(tmp_path / "t.txt", truth[:1]))
    assert (scores.fn, scores.fp, scores.mota) == (1, 0, 50.0)


def test_flags_and_threshold_reach_the_scores(recorded: tuple[Path, Path]) -> None:
    strict = evaluate(*recorded)
    assert evaluate(*recorded, flags="all").boxes > strict.boxes
    assert evaluate(*recorded, flags="ignore").fp < strict.fp
    loose = evaluate(*recorded, iou_threshold=0.3)
    assert loose.mota > strict.mota
    assert loose.hota == strict.hota


def test_json_is_one_object_a_line_with_the_promised_fields(recorded: tuple[Path, Path]) -> None:
    scores = evaluate(*recorded)
    lines = scores_json([scores, scores]).splitlines()
    assert [list(json.loads(line)) for line in lines] == [FIELDS, FIELDS]
    assert SequenceScores.model_validate_json(lines[0]) == scores


def test_every_field_is_described() -> None:
    assert all(field.description for field in SequenceScores.model_fields.values())


def test_scores_cannot_be_changed(recorded: tuple[Path, Path]) -> None:
    with pytest.raises(ValidationError):
        evaluate(*recorded).mota = 100.0  # type: ignore[misc]


def test_table_fits_80_characters_and_shows_every_number() -> None:
    row = SequenceScores(
        sequence="PETS09-S2L1",
        mota=-112.34,
        motp=67.73,
        idf1=42.16,
        hota=34.56,
        idsw=103,
        fp=10462,
        fn=11127,
        boxes=14476,
        keep=24.67,
        wrong=13.78,
        wrong_apart=3.21,
        dice=74.36,
    )
    console = Console(width=80)
    with console.capture() as captured:
        console.print(scores_table([row], caption="IoU 0.5"))
    text = captured.get()
    for shown in ("24.7", "13.8", "-112.3", "67.7", "42.2", "34.6", "103", "10462", "11127"):
        assert shown in text
    assert "14476" in text
    assert "74.4" in text
    assert "…" not in text


def test_directories_are_paired_by_sequence_name(draw_sequence: Draw, tmp_path: Path) -> None:
    truth, tracks = draw_sequence(0)
    for name in ("one", "two", "three"):
        save(tmp_path / "data" / name / "gt" / "gt.txt", truth)
    save(tmp_path / "out" / "two.txt", tracks)
    save(tmp_path / "out" / "one" / "tracks.txt", tracks)
    pairs = find_pairs(tmp_path / "data", tmp_path / "out")
    assert pairs == [
        (tmp_path / "data" / "one", tmp_path / "out" / "one" / "tracks.txt"),
        (tmp_path / "data" / "two", tmp_path / "out" / "two.txt"),
    ]


def test_one_sequence_is_one_pair(recorded: tuple[Path, Path]) -> None:
    assert find_pairs(*recorded) == [recorded]


def test_directories_without_a_pair_are_refused(tmp_path: Path) -> None:
    with pytest.raises(HeelError, match="nothing to score"):
        find_pairs(tmp_path, tmp_path)
