"""MOTA, MOTP, IDF1 and HOTA agree with TrackEval run the official way on files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from heel.evaluation.alignment import FlagRule, align, best_pairs
from heel.evaluation.motchallenge import read_detections, read_ground_truth
from heel.evaluation.tracking_scores import TrackingScores, tracking_scores
from heel.services.geometry.boxes import iou_matrix
from tests.support.box_rows import rows_from_array

Rows = NDArray[np.float64]
Draw = Callable[[int], tuple[Rows, Rows]]

A = [10, 10, 20, 40]


def score(
    truth: Rows, tracks: Rows, threshold: float = 0.5, flags: FlagRule = "mot15"
) -> TrackingScores:
    sequence = align(
        rows_from_array(truth, "ground truth"),
        rows_from_array(tracks, "tracks"),
        iou_threshold=threshold,
        flags=flags,
    )
    return tracking_scores(sequence, threshold)


def official(
    truth: Rows, tracks: Rows, folder: Path, threshold: float = 0.5, **dataset: Any
) -> dict[str, float]:
    """TrackEval's MotChallenge2DBox and Evaluator on files, as its own scripts use them."""
    trackeval = pytest.importorskip("trackeval")
    (folder / "gt" / "drawn" / "gt").mkdir(parents=True)
    (folder / "tracks" / "heel" / "data").mkdir(parents=True)
    np.savetxt(folder / "gt" / "drawn" / "gt" / "gt.txt", truth, delimiter=",", fmt="%.6g")
    np.savetxt(folder / "tracks" / "heel" / "data" / "drawn.txt", tracks, delimiter=",", fmt="%.6g")
    config = {
        "GT_FOLDER": str(folder / "gt"),
        "TRACKERS_FOLDER": str(folder / "tracks"),
        "TRACKERS_TO_EVAL": ["heel"],
        "SEQ_INFO": {"drawn": int(max(truth[:, 0].max(), tracks[:, 0].max()))},
        "SKIP_SPLIT_FOL": True,
        "DO_PREPROC": False,
        "PRINT_CONFIG": False,
        **dataset,
    }
    quiet = {"PRINT_CONFIG": False, "THRESHOLD": threshold}
    metrics = [
        trackeval.metrics.CLEAR(dict(quiet)),
        trackeval.metrics.Identity(dict(quiet)),
        trackeval.metrics.HOTA(),
    ]
    flags = ("PRINT_RESULTS", "PRINT_CONFIG", "TIME_PROGRESS", "OUTPUT_SUMMARY", "OUTPUT_DETAILED")
    evaluator = trackeval.Evaluator(
        dict.fromkeys((*flags, "PLOT_CURVES", "DISPLAY_LESS_PROGRESS"), False)
        | {"BREAK_ON_ERROR": True}
    )
    results, _ = evaluator.evaluate([trackeval.datasets.MotChallenge2DBox(config)], metrics)
    found = results["MotChallenge2DBox"]["heel"]["drawn"]["pedestrian"]
    return {
        "mota": 100 * found["CLEAR"]["MOTA"],
        "motp": 100 * found["CLEAR"]["MOTP"],
        "idf1": 100 * found["Identity"]["IDF1"],
        "hota": 100 * float(np.mean(found["HOTA"]["HOTA"])),
        "idsw": found["CLEAR"]["IDSW"],
        "fp": found["CLEAR"]["CLR_FP"],
        "fn": found["CLEAR"]["CLR_FN"],
    }


def assert_agrees(ours: TrackingScores, theirs: dict[str, float]) -> None:
    for name, value in theirs.items():
        tolerance = 0 if name in ("idsw", "fp", "fn") else 0.01
        assert getattr(ours, name) == pytest.approx(value, abs=tolerance), name


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("threshold", [0.3, 0.5, 0.7])
def test_agrees_with_official_trackeval(
    draw_sequence: Draw, tmp_path: Path, seed: int, threshold: float
) -> None:
    truth, tracks = draw_sequence(seed)
    ours = score(truth, tracks, threshold)
    assert ours.idsw > 0
    assert ours.fp > 0
    assert ours.fn > 0
    assert_agrees(ours, official(truth, tracks, tmp_path, threshold))


@pytest.mark.parametrize("seed", range(6))
def test_ignoring_flagged_people_is_trackevals_rule_for_distractors(
    draw_sequence: Draw, tmp_path: Path, seed: int
) -> None:
    truth, tracks = draw_sequence(seed)
    distractor, pedestrian = 8, 1
    truth[:, 7] = np.where(truth[:, 6] == 0, distractor, pedestrian)
    ours = score(truth, tracks, flags="ignore")
    assert ours != score(truth, tracks, flags="mot15")
    assert_agrees(ours, official(truth, tracks, tmp_path, BENCHMARK="MOT17", DO_PREPROC=True))


@pytest.mark.parametrize("sequence_dir", ["PETS09-S2L1", "TUD-Campus"], indirect=True)
def test_agrees_on_recorded_detections_joined_by_overlap(
    sequence_dir: Path, tmp_path: Path
) -> None:
    truth = np.loadtxt(sequence_dir / "gt" / "gt.txt", delimiter=",")
    truth[:, 7:] = -1
    tracks = join_by_overlap(sequence_dir / "det" / "det.txt")
    assert_agrees(score(truth, tracks), official(truth, tracks, tmp_path))


@pytest.mark.parametrize("sequence_dir", ["PETS09-S2L1", "TUD-Campus"], indirect=True)
def test_agrees_on_recorded_truth_that_was_jittered(sequence_dir: Path, tmp_path: Path) -> None:
    truth = np.loadtxt(sequence_dir / "gt" / "gt.txt", delimiter=",")
    truth[:, 7:] = -1
    rng = np.random.default_rng(0)
    tracks = truth[rng.random(len(truth)) < 0.8]
    tracks[:, 2:6] *= rng.normal(1, 0.02, (len(tracks), 4))
    tracks[:, 1] += 100 * (tracks[:, 0] // 60)
    assert_agrees(score(truth, tracks), official(truth, tracks, tmp_path))


@pytest.mark.parametrize("sequence_dir", ["PETS09-S2L1"], indirect=True)
@pytest.mark.parametrize(("flags", "boxes", "fp"), [("mot15", 4476, 174), ("ignore", 4476, 0)])
def test_recorded_flags_leave_4476_boxes(
    sequence_dir: Path, flags: FlagRule, boxes: int, fp: int
) -> None:
    rows = read_ground_truth(sequence_dir / "gt" / "gt.txt")
    scores = tracking_scores(align(rows, rows, flags=flags))
    assert (scores.boxes, scores.fp, scores.fn) == (boxes, fp, 0)


def test_perfect_tracks_score_hundred() -> None:
    truth = np.array([[frame, 1, *A, 1] for frame in range(1, 6)])
    assert score(truth, truth) == TrackingScores(100, 100, 100, 100, 0, 0, 0, 5)


def test_no_tracks_at_all_are_all_misses() -> None:
    truth = np.array([[frame, 1, *A, 1] for frame in range(1, 6)])
    assert score(truth, np.empty((0, 7))) == TrackingScores(0, 0, 0, 0, 0, 0, 5, 5)


def test_tracks_where_there_is_no_ground_truth_are_false_positives() -> None:
    truth = np.array([[5, 1, *A, 1]])
    tracks = np.array([[frame, 1, *A, 1] for frame in (1, 5, 9)])
    scores = score(truth, tracks)
    assert (scores.fp, scores.fn, scores.mota) == (2, 0, -100.0)


@given(
    st.lists(
        st.tuples(st.integers(1, 8), st.integers(0, 4), st.integers(0, 6), st.booleans()),
        min_size=1, max_size=60, unique_by=lambda one: (one[0], one[1], one[3]),
    )
)  # fmt: skip
@settings(max_examples=60, deadline=None)
def test_equals_trackeval_on_anything(boxes: list[tuple[int, int, int, bool]]) -> None:
    """Few places, so that overlaps are equal and boxes come together, and frames with nobody."""
    metrics = pytest.importorskip("trackeval.metrics")
    truth, tracks = (
        np.array([[f, i, 10 + 7 * x, 10, 20, 40, 1] for f, i, x, true in boxes if true == side])
        for side in (True, False)
    )
    assume(len(truth) > 0)
    sequence = align(
        rows_from_array(truth, "ground truth"),
        rows_from_array(tracks if len(tracks) else np.empty((0, 7)), "tracks"),
    )
    ours = tracking_scores(sequence)
    frames = sequence.frames
    data = {
        "num_timesteps": sequence.frame_count,
        "num_gt_ids": len(sequence.gt_identities),
        "num_tracker_ids": len(sequence.track_identities),
        "num_gt_dets": len(truth),
        "num_tracker_dets": len(tracks),
        "gt_ids": [frame.gt for frame in frames],
        "tracker_ids": [frame.tracks for frame in frames],
        "similarity_scores": [frame.iou for frame in frames],
    }
    quiet = {"THRESHOLD": 0.5, "PRINT_CONFIG": False}
    clear = metrics.CLEAR(dict(quiet)).eval_sequence(data)
    identity = metrics.Identity(dict(quiet)).eval_sequence(data)
    hota = metrics.HOTA().eval_sequence(data)
    assert (ours.idsw, ours.fp, ours.fn) == (clear["IDSW"], clear["CLR_FP"], clear["CLR_FN"])
    assert ours.mota == pytest.approx(100 * clear["MOTA"])
    assert ours.motp == pytest.approx(100 * clear["MOTP"])
    assert ours.idf1 == pytest.approx(100 * identity["IDF1"])
    assert ours.hota == pytest.approx(100 * float(np.mean(hota["HOTA"])))


def join_by_overlap(detections: Path) -> Rows:
    """Tracks of the simplest kind: a box takes the identity of the one it overlaps most before."""
    rows = read_detections(detections)
    identities = np.zeros(len(rows), dtype=np.int64)
    last_boxes, last_identities, count = np.empty((0, 4)), np.empty(0, dtype=np.int64), 0
    for frame in np.unique(rows.frames):
        here = np.flatnonzero(rows.frames == frame)
        old, new = best_pairs(iou_matrix(last_boxes, rows.boxes_xyxy[here]), 0.3)
        mine = np.arange(count, count + len(here))
        count += len(here)
        mine[new] = last_identities[old]
        last_boxes, last_identities = rows.boxes_xyxy[here], mine
        identities[here] = mine
    size = rows.boxes_xyxy[:, 2:] - rows.boxes_xyxy[:, :2]
    columns = (rows.frames, identities, rows.boxes_xyxy[:, :2] + 1, size, rows.values)
    return np.column_stack([*columns, np.full((len(rows), 3), -1.0)]).round(3)
