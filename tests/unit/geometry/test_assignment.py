"""One-to-one assignment, against trying everything."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from heel.services.geometry.assignment import cheapest, cheapest_without, heaviest_pairs

COSTS = arrays(
    np.float64,
    st.integers(1, 4).flatmap(lambda rows: st.tuples(st.just(rows), st.integers(rows, 5))),
    elements=st.integers(0, 30).map(float),
)


def every_total(costs: np.ndarray) -> list[float]:
    rows, columns = costs.shape
    return [
        float(costs[np.arange(rows), list(chosen)].sum())
        for chosen in permutations(range(columns), rows)
    ]


@given(COSTS)
def test_nothing_is_cheaper_or_heavier(costs: np.ndarray) -> None:
    best = cheapest(costs)
    assert len(set(best.columns.tolist())) == len(costs)
    assert best.total == costs[np.arange(len(costs)), best.columns].sum() == min(every_total(costs))
    rows, columns = heaviest_pairs(costs)
    assert costs[rows, columns].sum() == max(every_total(costs))


@given(COSTS)
def test_without_a_pair_the_next_cheapest_comes(costs: np.ndarray) -> None:
    best = cheapest(costs)
    other = cheapest_without(costs, 0, int(best.columns[0]), 1e6)
    costs[0, best.columns[0]] = 1e6
    assert other.total == min(every_total(costs)) >= best.total


def test_light_pairs_are_left_out_after_the_best_are_found() -> None:
    rows, columns = heaviest_pairs(np.array([[0.9, 0.8], [0.8, 0.2], [0.1, 0.1]]), above=0.5)
    assert list(zip(rows.tolist(), columns.tolist(), strict=True)) == [(0, 1), (1, 0)]
    rows, columns = heaviest_pairs(np.array([[0.5]]), above=0.5)
    assert rows.size == columns.size == 0


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (0, 0)])
def test_nothing_is_assigned_to_nothing(shape: tuple[int, int]) -> None:
    rows, columns = heaviest_pairs(np.zeros(shape))
    assert rows.size == columns.size == 0
