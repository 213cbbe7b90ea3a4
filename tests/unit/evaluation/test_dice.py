"""The paper's equation 7 on areas."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from heel.evaluation.alignment import AlignedSequence, align
from heel.evaluation.dice import dice_per_frame, mean_dice, union_area
from heel.evaluation.rows import rows_from_xyxy
from tests.support.box_rows import rows_from_array


def sequence(
    truth: Sequence[Sequence[float]], tracks: Sequence[Sequence[float]], frame_count: int = 0
) -> AlignedSequence:
    return align(
        rows_from_array(np.array(truth), "ground truth"),
        rows_from_array(np.array(tracks), "tracks"),
        frame_count=frame_count,
    )


@pytest.mark.parametrize(
    ("boxes", "area"),
    [
        ([], 0),
        ([[0, 0, 10, 10]], 100),
        ([[0, 0, 10, 10], [20, 0, 30, 10]], 200),
        ([[0, 0, 10, 10], [5, 5, 15, 15]], 175),
        ([[0, 0, 10, 10], [2, 2, 4, 4]], 100),
        ([[0, 0, 10, 10], [0, 0, 10, 10]], 100),
        ([[0, 0, 10, 10], [10, 0, 20, 10]], 200),
        ([[-5, -5, 5, 5]], 100),
    ],
)
def test_union_counts_every_place_once(boxes: Sequence[Sequence[float]], area: float) -> None:
    assert union_area(np.array(boxes, dtype=np.float64).reshape(-1, 4)) == area


def test_union_equals_counting_pixels() -> None:
    rng = np.random.default_rng(4)
    for _ in range(20):
        corner = rng.integers(0, 60, (6, 2))
        boxes = np.hstack([corner, corner + rng.integers(1, 40, (6, 2))])
        raster = np.zeros((100, 100), dtype=np.bool_)
        for x1, y1, x2, y2 in boxes:
            raster[y1:y2, x1:x2] = True
        assert union_area(boxes.astype(np.float64)) == raster.sum()


@pytest.mark.parametrize(
    ("tracks", "accuracy"),
    [
        pytest.param([[1, 7, 10, 10, 20, 40, 1]], 100.0, id="the same box"),
        pytest.param([[1, 7, 20, 10, 20, 40, 1]], 50.0, id="half of it"),
        pytest.param([[1, 7, 10, 10, 20, 80, 1]], 200 / 3, id="twice as tall"),
        pytest.param([[1, 7, 90, 90, 20, 40, 1]], 0.0, id="somewhere else"),
        pytest.param([], 0.0, id="nothing"),
        pytest.param(
            [[1, 7, 10, 10, 20, 20, 1], [1, 8, 10, 30, 20, 20, 1]], 100.0, id="two halves"
        ),
        pytest.param(
            [[1, 7, 10, 10, 20, 40, 1], [1, 8, 10, 10, 20, 40, 1]], 100.0, id="two on top"
        ),
    ],
)
def test_equation_7(tracks: Sequence[Sequence[float]], accuracy: float) -> None:
    result = dice_per_frame(sequence([[1, 1, 10, 10, 20, 40, 1]], tracks))
    assert result.tolist() == pytest.approx([accuracy])


def test_frames_without_any_box_are_undefined_and_not_averaged() -> None:
    truth: Sequence[Sequence[float]] = [[2, 1, 10, 10, 20, 40, 1], [3, 1, 10, 10, 20, 40, 1]]
    tracks: Sequence[Sequence[float]] = [[2, 7, 10, 10, 20, 40, 1], [5, 7, 10, 10, 20, 40, 1]]
    drawn = sequence(truth, tracks, frame_count=6)
    np.testing.assert_array_equal(dice_per_frame(drawn), [np.nan, 100, 0, np.nan, 0, np.nan])
    assert mean_dice(drawn) == pytest.approx(100 / 3)


@pytest.mark.parametrize(("shift_px", "expected"), [(0.0, 100.0), (1000.0, 0.0)])
def test_rounding_never_carries_accuracy_out_of_0_to_100(shift_px: float, expected: float) -> None:
    rng = np.random.default_rng(0)
    frames, identities = np.repeat(np.arange(1, 301), 3), np.tile(np.arange(3), 300)
    corner = rng.uniform(0, 500, (900, 2))
    boxes = np.hstack([corner, corner + rng.uniform(1, 90, (900, 2))])
    truth = rows_from_xyxy(frames, identities, boxes)
    tracks = rows_from_xyxy(frames, identities, boxes + shift_px)
    accuracy = dice_per_frame(align(truth, tracks, flags="all"))
    assert accuracy.min() >= 0.0
    assert accuracy.max() <= 100.0
    assert accuracy == pytest.approx(np.full(300, expected))
