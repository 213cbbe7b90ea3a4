"""Single-target scores against sequences whose scores are counted by hand."""

from __future__ import annotations

import numpy as np
import pytest

from heel.evaluation.rows import BoxRows, rows_from_xyxy
from heel.evaluation.single_target import single_target_scores
from heel.schemas.errors import HeelError

Row = tuple[int, int, float]
"""Frame, identity, x of the left edge of a box 10 wide and 30 high."""


def rows(*given: Row) -> BoxRows:
    boxes = np.array([[x, 0.0, x + 10.0, 30.0] for _, _, x in given]).reshape(-1, 4)
    return rows_from_xyxy([row[0] for row in given], [row[1] for row in given], boxes)


TARGET = rows(*((frame, 1, 100.0) for frame in range(1, 11)))


def test_a_box_always_on_the_target_scores_everything_but_the_last_threshold() -> None:
    scores = single_target_scores(TARGET, rows(*((frame, 7, 100.0) for frame in range(1, 11))))
    assert (scores.identity, scores.frames) == (7, 10)
    assert (scores.on_target, scores.elsewhere, scores.precision) == (100.0, 0.0, 100.0)
    # An overlap of 1 is larger than 20 of the 21 thresholds.
    assert scores.success_auc == pytest.approx(100.0 * 20 / 21)


def test_frames_before_the_choice_and_without_a_box_are_missed() -> None:
    scores = single_target_scores(TARGET, rows(*((frame, 7, 100.0) for frame in range(4, 9))))
    assert (scores.on_target, scores.precision, scores.elsewhere) == (50.0, 50.0, 0.0)


def test_the_identity_is_chosen_once_and_never_again() -> None:
    shown = rows(
        *((frame, 7, 100.0) for frame in range(1, 5)),
        *((frame, 8, 100.0) for frame in range(5, 11)),
        *((frame, 7, 300.0) for frame in range(5, 8)),
    )
    scores = single_target_scores(TARGET, shown)
    assert (scores.identity, scores.on_target, scores.elsewhere) == (7, 40.0, 30.0)


def test_a_box_beside_the_target_is_neither_on_it_nor_elsewhere() -> None:
    # Shifted by 5 of 10: overlap 1/3; by 8: 2/18 and still within 20 px.
    shown = rows((1, 7, 100.0), (2, 7, 105.0), (3, 7, 108.0), (4, 7, 121.0))
    scores = single_target_scores(TARGET, shown)
    assert (scores.on_target, scores.elsewhere, scores.precision) == (10.0, 20.0, 30.0)
    # 20 thresholds below 1, 7 below 1/3 (0 to 0.30), 3 below 1/9 (0 to 0.10).
    assert scores.success_auc == pytest.approx(100.0 * (20 + 7 + 3) / 21 / 10)


def test_nearby_boxes_are_not_chosen() -> None:
    scores = single_target_scores(TARGET, rows((1, 7, 105.0), (2, 8, 101.0)))
    assert (scores.identity, scores.on_target) == (8, 10.0)
    nobody = single_target_scores(TARGET, rows((1, 7, 105.0)))
    assert (nobody.identity, nobody.on_target, nobody.success_auc) == (None, 0.0, 0.0)


def test_truth_of_several_people_is_refused() -> None:
    with pytest.raises(HeelError, match="2 people; select the rows of one"):
        single_target_scores(rows((1, 1, 0.0), (1, 2, 50.0)), rows((1, 7, 0.0)))
