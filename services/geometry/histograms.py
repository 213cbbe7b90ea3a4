"""Soft histograms: each value is shared between its nearest bins, so that a slight change of light
moves a histogram only slightly."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

Positions = NDArray[np.floating[Any]]


def soft_counts(
    length: int,
    first: NDArray[np.intp],
    axes: Sequence[tuple[Positions, int, int]],
    weights: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Histograms of one or more axes, many of them in one array.

    Args:
        length: of the array of all bins.
        first: (K,) index of the first bin of the histogram that each value belongs to.
        axes: of each axis the positions (K,) in bins, 0 to bins - 1; the number of bins; and how
            far apart two of its bins lie in the array.
        weights: (K,) of each value; 1 if left out.

    Returns:
        (length,) sums of the shares.
    """
    corners = []
    for positions, bins, stride in axes:
        low = np.minimum(positions.astype(np.intp), bins - 2)
        above = positions - low
        corners.append(((low * stride, 1.0 - above), ((low + 1) * stride, above)))
    total = np.zeros(length)
    for parts in product(*corners):
        place, share = first + parts[0][0], parts[0][1]
        for offset, part in parts[1:]:
            place, share = place + offset, share * part
        total += np.bincount(place, share if weights is None else weights * share, length)
    return total
