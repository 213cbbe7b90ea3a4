"""Floors on the recordings: worse than this, and something that worked has been broken."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from heel.evaluation.motchallenge import read_ground_truth, write_tracks
from heel.evaluation.sequence_scores import SequenceScores, evaluate
from heel.services.commands.track_detections import read_given, shown_rows
from heel.services.tracker.boxes.sequence import GivenSequence, track_sequence

DATA = Path(os.environ.get("HEEL_DATA", Path(__file__).parents[5] / "shared" / "data"))


def folder_of(name: str) -> Path:
    folder = DATA / name
    if not (folder / "det" / "det.txt").is_file():
        pytest.skip(f"no {name} in {DATA}: set HEEL_DATA")
    return folder


def scores_of(folder: Path, given: GivenSequence, out: Path) -> SequenceScores:
    write_tracks(out / "tracks.txt", shown_rows(track_sequence(given)))
    return evaluate(folder, out / "tracks.txt")


def test_true_boxes_without_ids_get_their_ids_back(tmp_path: Path) -> None:
    folder = folder_of("PETS09-S2L1")
    truth = read_ground_truth(folder / "gt" / "gt.txt")
    truth = truth.select(truth.values != 0)
    given = replace(
        read_given(folder), frames=truth.frames, boxes=truth.boxes_xyxy, scores=np.ones(len(truth))
    )
    scores = scores_of(folder, given, tmp_path)
    assert scores.idf1 >= 98
    assert scores.idsw == 0


@pytest.mark.parametrize(
    ("name", "mota"),
    [
        ("PETS09-S2L1", 65.0),
        ("PETS09-S3MF1", 69.0),
        ("TUD-Campus", 55.0),
        ("MOT15-noframes/KITTI-13", 16.5),
        ("MOT15-noframes/ETH-Bahnhof", 44.0),
    ],
)
def test_detectors_of_any_score_scale_are_served(name: str, mota: float, tmp_path: Path) -> None:
    folder = folder_of(name)
    assert scores_of(folder, read_given(folder), tmp_path).mota >= mota
