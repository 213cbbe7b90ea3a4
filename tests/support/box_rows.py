"""Rows of boxes from numbers, for tests of scores."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from heel.evaluation.rows import BoxRows, RowKind, check_rows


def rows_from_array(array: NDArray[Any], kind: RowKind) -> BoxRows:
    """Rows from six or seven columns of a MOTChallenge file, whose pixels count from 1."""
    given = np.asarray(array, np.float64)
    given = given if given.size else given.reshape(0, 7)
    table = np.ones((len(given), 7))
    table[:, : given.shape[1]] = given[:, :7]
    return check_rows(table, np.arange(1, len(table) + 1), kind, f"{kind}: row")
