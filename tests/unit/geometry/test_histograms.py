"""Soft histograms: every value counts once, between the bins beside it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heel.services.geometry.histograms import soft_counts

ORIGIN = np.zeros(1, np.intp)


def test_a_value_is_shared_between_the_bins_beside_it() -> None:
    assert soft_counts(4, ORIGIN, [(np.array([1.25]), 4, 1)]).tolist() == [0, 0.75, 0.25, 0]
    assert soft_counts(4, ORIGIN, [(np.array([3.0]), 4, 1)]).tolist() == [0, 0, 0, 1]


def test_two_axes_share_between_four_bins() -> None:
    counts = soft_counts(6, ORIGIN, [(np.array([0.5]), 2, 3), (np.array([1.25]), 3, 1)])
    assert counts.reshape(2, 3).tolist() == [[0, 0.375, 0.125], [0, 0.375, 0.125]]


def test_histograms_lie_beside_one_another_and_weights_count() -> None:
    first = np.array([0, 0, 3], np.intp)
    counts = soft_counts(6, first, [(np.array([0.0, 1.0, 1.5]), 3, 1)], np.array([2.0, 1.0, 4.0]))
    assert counts.tolist() == [2, 1, 0, 0, 2, 2]


@given(st.lists(st.tuples(st.floats(0, 7), st.floats(0, 4)), min_size=1, max_size=20))
def test_every_value_counts_once_and_the_mean_stays(values: list[tuple[float, float]]) -> None:
    a, b = np.array(values).T
    counts = soft_counts(40, np.zeros(len(a), np.intp), [(a, 8, 5), (b, 5, 1)]).reshape(8, 5)
    assert counts.sum() == pytest.approx(len(a))
    assert (counts.sum(axis=1) * np.arange(8)).sum() == pytest.approx(a.sum(), abs=1e-9)
    assert (counts.sum(axis=0) * np.arange(5)).sum() == pytest.approx(b.sum(), abs=1e-9)
