"""Boxes: what they have in common, one by one and as arrays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from heel.schemas.base import BoxXyxy
from heel.services.geometry import boxes

WHOLE = (0.0, 0.0, 10.0, 10.0)
_SIDES = st.integers(-8000, 8000).map(lambda sixteenths: sixteenths / 16)
MANY = arrays(np.float64, st.tuples(st.integers(0, 5), st.just(4)), elements=_SIDES).map(
    lambda corners: np.hstack([
        np.minimum(corners[:, :2], corners[:, 2:]), np.maximum(corners[:, :2], corners[:, 2:])
    ])
)  # fmt: skip


@pytest.mark.parametrize(
    ("other", "iou", "cover", "of_smaller"),
    [
        pytest.param(WHOLE, 1, 1, 1, id="the same"),
        pytest.param((5, 0, 15, 10), 1 / 3, 1 / 2, 1 / 2, id="half of each"),
        pytest.param((2, 2, 4, 7), 1 / 10, 1 / 10, 1, id="a part of it"),
        pytest.param((10, 0, 20, 10), 0, 0, 0, id="side by side"),
        pytest.param((20, 20, 30, 30), 0, 0, 0, id="apart both ways"),
        pytest.param((3, 3, 3, 3), 0, 0, 0, id="without area"),
        pytest.param((8, 8, 2, 2), 0, 0, 0, id="inside out"),
    ],
)
def test_what_two_boxes_have_in_common(
    other: BoxXyxy, iou: float, cover: float, of_smaller: float
) -> None:
    assert boxes.iou(WHOLE, other) == pytest.approx(iou)
    assert boxes.cover(WHOLE, other) == pytest.approx(cover)
    assert boxes.cover_of_smaller(WHOLE, other) == pytest.approx(of_smaller)
    first, second = np.array([WHOLE]), np.array([other], np.float64)
    assert boxes.iou_matrix(first, second) == pytest.approx(np.array([[iou]]))
    assert boxes.cover_matrix(first, second) == pytest.approx(np.array([[cover]]))


@given(MANY, MANY)
def test_arrays_of_boxes_give_what_single_boxes_give(first: np.ndarray, second: np.ndarray) -> None:
    for matrix, one in (
        (boxes.intersection_matrix, boxes.intersection),
        (boxes.iou_matrix, boxes.iou),
        (boxes.cover_matrix, boxes.cover),
    ):
        found = matrix(first, second)
        assert found.shape == (len(first), len(second))
        assert found.tolist() == [[one(a, b) for b in second.tolist()] for a in first.tolist()]
    assert boxes.areas(first).tolist() == [boxes.area(box) for box in first.tolist()]


def test_two_boxes_without_area_have_nothing_in_common() -> None:
    gone = (0.0, 480.0, 640.0, 480.0)
    assert boxes.iou(gone, gone) == 0
    assert boxes.cover(gone, WHOLE) == boxes.cover_of_smaller(gone, gone) == 0
    array = boxes.as_array([gone, WHOLE])
    assert boxes.iou_matrix(array, array).tolist() == [[0, 0], [0, 1]]
    assert boxes.cover_matrix(array, array).tolist() == [[0, 0], [0, 1]]


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_the_precision_stays(precision: type[np.floating]) -> None:
    array = np.array([WHOLE], precision)
    found = (
        boxes.areas(array), boxes.intersection_matrix(array, array), boxes.iou_matrix(array, array),
        boxes.cover_matrix(array, array), boxes.clipped(array, (5, 5)),
    )  # fmt: skip
    assert {one.dtype for one in found} == {np.dtype(precision)}


def test_clipped_boxes_lie_in_the_picture() -> None:
    array = boxes.as_array([(-5, -5, 5, 5), (630, 470, 700, 500), (700, 10, 720, 40)])
    clipped = boxes.clipped(array, (640, 480))
    assert clipped.tolist() == [[0, 0, 5, 5], [630, 470, 640, 480], [640, 10, 640, 40]]
    assert boxes.areas(clipped).tolist() == [25, 100, 0]


def test_no_boxes_are_an_array_too() -> None:
    none = boxes.as_array([])
    assert none.shape == boxes.clipped(none, (5, 5)).shape == (0, 4)
    assert boxes.iou_matrix(none, boxes.as_array([WHOLE])).shape == (0, 1)


def test_where_a_box_is() -> None:
    box = (10.0, 20.0, 30.0, 80.0)
    assert (boxes.width(box), boxes.height(box), boxes.area(box)) == (20, 60, 1200)
    assert boxes.centre(box) == (20, 50)
    assert boxes.around((20, 50), 20, 60) == box
    assert boxes.moved(box, 5, -10) == (15, 10, 35, 70)
    assert boxes.enclosing([box, (0, 25, 12, 90), (11, 40, 35, 41)]) == (0, 20, 35, 90)


def test_a_box_is_shifted_into_a_larger_one_and_centred_on_a_smaller_one() -> None:
    assert boxes.kept_inside((-4, 5, 6, 9), WHOLE) == (0, 5, 10, 9)
    assert boxes.kept_inside((6, 12, 12, 14), WHOLE) == (4, 8, 10, 10)
    assert boxes.kept_inside((0, 2, 30, 4), WHOLE) == (-10, 2, 20, 4)
