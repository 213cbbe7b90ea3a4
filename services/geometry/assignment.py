"""One-to-one assignment of rows to columns: the heaviest pairs, the cheapest, the next cheapest.

H. W. Kuhn, "The Hungarian method for the assignment problem", 1955; J. Munkres, 1957. scipy solves
it by the method of R. Jonker and A. Volgenant, 1987. Of equal totals the same one comes each time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib.machinery import PathFinder
from importlib.util import module_from_spec

import numpy as np
import scipy
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
Solver = Callable[..., tuple[Indices, Indices]]


def _solver() -> Solver:
    """scipy's `linear_sum_assignment`, without the rest of `scipy.optimize` where that can be.

    All of it takes as long to import as everything else that a tracker needs, a second, and a robot
    stands for that long when its tracker comes back after a crash.
    """
    found = PathFinder.find_spec("_lsap", [f"{folder}/optimize" for folder in scipy.__path__])
    if found is not None and found.loader is not None:
        module = module_from_spec(found)
        found.loader.exec_module(module)
        if hasattr(module, "linear_sum_assignment"):
            alone: Solver = module.linear_sum_assignment
            return alone
    from scipy.optimize import linear_sum_assignment

    whole: Solver = linear_sum_assignment
    return whole


linear_sum_assignment = _solver()


def heaviest_pairs(weights: Floats, above: float = -math.inf) -> tuple[Indices, Indices]:
    """Rows and columns (equally long) of the pairs with the greatest total weight.

    Args:
        weights: (N, M). Every row gets a column, or every column a row, whichever is fewer.
        above: of these pairs only those of a greater weight are kept.
    """
    rows, columns = linear_sum_assignment(weights, maximize=True)
    kept = weights[rows, columns] > above
    return rows[kept], columns[kept]


@dataclass(frozen=True, eq=False)
class Assignment:
    """The cheapest assignment of every row to a column of its own.

    Attributes:
        columns: (N,), by row.
        total: the sum of its costs.
    """

    columns: Indices
    total: float


def cheapest(costs: Floats) -> Assignment:
    """The assignment of least total cost, of (N, M) with N <= M."""
    rows, columns = linear_sum_assignment(costs)
    return Assignment(columns, float(costs[rows, columns].sum()))


def cheapest_without(costs: Floats, row: int, column: int, impossible: float) -> Assignment:
    """The cheapest assignment of (N, M) with N <= M in which this pair costs `impossible`.

    How much dearer it is than the cheapest of all tells how sure that pair is.
    """
    without = costs.copy()
    without[row, column] = impossible
    return cheapest(without)
