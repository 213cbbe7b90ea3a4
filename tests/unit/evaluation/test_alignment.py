"""What counts as ground truth, which frames are evaluated, and which boxes pair up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from heel.evaluation.alignment import AlignedSequence, FlagRule, align, best_pairs
from heel.schemas.errors import HeelError
from tests.support.box_rows import rows_from_array

A, B = [10, 10, 20, 40], [14, 10, 20, 40]  # IoU of the two is 2/3


def sequence(
    truth: Sequence[Sequence[float]],
    tracks: Sequence[Sequence[float]],
    flags: FlagRule = "mot15",
    frame_count: int = 0,
) -> AlignedSequence:
    return align(
        rows_from_array(np.array(truth), "ground truth"),
        rows_from_array(np.array(tracks), "tracks"),
        flags=flags,
        frame_count=frame_count,
    )


@pytest.mark.parametrize(
    ("flags", "true_boxes", "output_boxes"),
    [("mot15", 1, 2), ("ignore", 1, 1), ("all", 2, 2)],
)
def test_flag_rule_decides_about_flagged_rows_and_outputs_on_them(
    flags: FlagRule, true_boxes: int, output_boxes: int
) -> None:
    truth = [[1, 1, 10, 10, 20, 40, 1], [1, 2, 200, 10, 20, 40, 0]]
    tracks = [[1, 7, 10, 10, 20, 40, 1], [1, 8, 202, 10, 20, 40, 1]]
    frame = sequence(truth, tracks, flags).frames[0]
    assert (len(frame.gt), len(frame.tracks)) == (true_boxes, output_boxes)


def test_ignored_person_does_not_take_the_output_of_a_scored_one() -> None:
    truth = [[1, 1, *A, 1], [1, 2, *B, 0]]
    kept = sequence(truth, [[1, 7, *A, 1], [1, 8, *B, 1]], "ignore")
    assert kept.track_identities.tolist() == [7]


def test_second_output_on_an_ignored_person_stays() -> None:
    truth = [[1, 1, 300, 10, 20, 40, 1], [1, 2, *A, 0]]
    kept = sequence(truth, [[1, 7, *A, 1], [1, 8, *B, 1]], "ignore")
    assert kept.track_identities.tolist() == [8]


@pytest.mark.parametrize(
    ("frame_count", "last_truth", "last_track", "evaluated"),
    [(9, 3, 5, 9), (0, 3, 5, 5), (2, 6, 5, 6), (2, 3, 8, 8)],
)
def test_evaluated_frames_reach_to_the_last_of_length_truth_and_tracks(
    frame_count: int, last_truth: int, last_track: int, evaluated: int
) -> None:
    result = sequence(
        [[1, 1, *A, 1], [last_truth, 1, *A, 1]],
        [[1, 7, *A, 1], [last_track, 7, *A, 1]],
        frame_count=frame_count,
    )
    assert result.frame_count == evaluated


def test_identities_are_numbered_from_zero_in_the_order_of_the_file() -> None:
    result = sequence([[1, 40, *A, 1], [2, 20, *A, 1]], [[2, 9, *A, 1]])
    assert result.gt_identities.tolist() == [20, 40]
    assert [frame.gt.tolist() for frame in result.frames] == [[1], [0]]


@pytest.mark.parametrize("truth", [[], [[1, 1, *A, 0]]])
def test_nothing_to_score_against_is_an_error(truth: Sequence[Sequence[float]]) -> None:
    with pytest.raises(HeelError, match=f"none of {len(truth)} ground-truth rows is left"):
        sequence(truth, [[1, 7, *A, 1]])


def test_unknown_flag_rule_is_refused() -> None:
    with pytest.raises(HeelError, match="flags = 'mot16'; choose one of mot15, ignore, all"):
        sequence([[1, 1, *A, 1]], [], flags="mot16")  # type: ignore[arg-type]


@pytest.mark.parametrize("threshold", [0.0, -0.5, 1.01, float("nan")])
def test_threshold_outside_its_range_is_refused(threshold: float) -> None:
    rows = rows_from_array(np.array([[1, 1, *A, 1]]), "ground truth")
    with pytest.raises(HeelError, match="iou_threshold"):
        align(rows, rows, iou_threshold=threshold)


@pytest.mark.parametrize(
    ("iou", "preferred", "pairs"),
    [
        pytest.param([[0.5]], None, [(0, 0)], id="the threshold itself pairs"),
        pytest.param([[0.49]], None, [], id="below it does not"),
        pytest.param([[0.9, 0.8], [0.8, 0.0]], None, [(0, 1), (1, 0)], id="highest total"),
        pytest.param([[0.9, 0.6]], [[False, True]], [(0, 1)], id="preferred before IoU"),
        pytest.param([[0.9, 0.4]], [[False, True]], [(0, 0)], id="never below the threshold"),
    ],
)
def test_best_pairs(
    iou: Sequence[Sequence[float]],
    preferred: list[list[bool]] | None,
    pairs: list[tuple[int, int]],
) -> None:
    wished = None if preferred is None else np.array(preferred)
    rows, columns = best_pairs(np.array(iou), 0.5, wished)
    assert list(zip(rows.tolist(), columns.tolist(), strict=True)) == pairs
