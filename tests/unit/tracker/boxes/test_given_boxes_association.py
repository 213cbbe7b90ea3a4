"""Marginal probabilities of pairs, against the sum over all assignments."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from heel.services.tracker.people.association import marginals


def exact(log_odds: list[list[float]]) -> list[list[float]]:
    """By counting every way to pair tracks and boxes."""
    tracks, boxes = len(log_odds), len(log_odds[0])
    total, parts = 0.0, np.zeros((tracks, boxes))
    for choice in itertools.product(range(-1, boxes), repeat=tracks):
        taken = [box for box in choice if box >= 0]
        if len(set(taken)) < len(taken):
            continue
        weight = math.exp(sum(log_odds[i][j] for i, j in enumerate(choice) if j >= 0))
        total += weight
        for i, j in enumerate(choice):
            if j >= 0:
                parts[i, j] += weight
    return np.asarray(parts / total).tolist()


@pytest.mark.parametrize(
    "log_odds",
    [
        pytest.param([[2.0]], id="one"),
        pytest.param([[3.0, -1.0], [-2.0, 4.0]], id="two, clear"),
        pytest.param([[45.0, 3.0], [40.0, 2.0]], id="two want one, and far more than not"),
        pytest.param([[48.0, -20.0, -20.0]], id="as sure as can be"),
        pytest.param([[5.0], [4.0], [-50.0]], id="one box for three"),
    ],
)
def test_marginals_are_those_of_all_assignments(log_odds: list[list[float]]) -> None:
    found = marginals(np.array(log_odds))

    assert np.isfinite(found).all()
    assert found.tolist() == [pytest.approx(row, abs=0.02) for row in exact(log_odds)]
