"""Identities after a split: the paper's S1 against S2 (eq. 5 and 6), for any number of people.

S1 and S2 are the total costs of the two ways to give two people to two blobs. For N people there
are N! ways; Kuhn-Munkres finds the cheapest in O(N^3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.services.geometry.assignment import cheapest, cheapest_without
from heel.services.tracker.paper.features import FAMILIES, Features

_IMPOSSIBLE = 1e6
"""Cost of a pair that is ruled out: more than any sum of possible ones, whose mean is 1."""
_LEAST_DISTANCE = 1e-5
"""Mean distance of a family below which it is left out: of people without texture 32-bit floats
leave errors of rounding, other ones on each processor, and a mean would make them count in full."""


@dataclass(frozen=True, slots=True)
class Retention:
    """The identity decision at one split.

    Attributes:
        slots: for each person the column of the cost matrix, a permutation.
        confidence: for each person, that this is right, 0 to 1.
    """

    slots: tuple[int, ...]
    confidence: tuple[float, ...]


def cost_matrix(
    references: Sequence[Features], currents: Sequence[Features]
) -> NDArray[np.float64]:
    """L1 distances of each person's reference to each part's features.

    The families have different units, so each family's distances are divided by their mean over
    the matrix before they are summed. The result has mean 1.

    Args:
        references: N people's features from before the merge.
        currents: M parts' features.

    Returns:
        (N, M) float64.
    """
    total = np.zeros((len(references), len(currents)))
    for family in FAMILIES:
        distances = np.array([[float(np.abs(current[family] - reference[family]).sum())
                               for current in currents] for reference in references])  # fmt: skip
        mean = float(distances.mean())
        if mean > _LEAST_DISTANCE:
            total += distances / mean
    mean = float(total.mean())
    return total / mean if mean > 0 else total


def retain(costs: NDArray[np.float64], sharpness: float) -> Retention:
    """The cheapest assignment, and for each person how much dearer any other one is.

    Args:
        costs: (N, N), mean about 1.
        sharpness: factor on the difference of mean costs before the logistic function.
    """
    best = cheapest(costs)
    columns = best.columns.tolist()
    confidence = []
    for row, column in enumerate(columns):
        other = cheapest_without(costs, row, column, _IMPOSSIBLE)
        margin = (other.total - best.total) / len(costs)
        confidence.append(float(1.0 / (1.0 + np.exp(-min(sharpness * margin, 50.0)))))
    return Retention(tuple(columns), tuple(confidence))
