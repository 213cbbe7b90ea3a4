"""Galleries in a learned metric: their views as it maps them, and distances to them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.learned_metric.metric import Metric
from heel.services.tracker.people import looks
from heel.services.tracker.people.appearance import FloatArray


class Gallery(looks.Gallery):
    """The tracker's gallery of one person, with its views as a metric maps them."""

    def __init__(self) -> None:
        """Start without descriptors."""
        super().__init__()
        self._mapped: tuple[Metric, FloatArray] | None = None

    def add(self, look: FloatArray) -> None:
        """Take in a (D,) descriptor of the person seen alone."""
        self._mapped = None
        super().add(look)

    def mapped(self, metric: Metric) -> FloatArray:
        """The views (V, K) as `metric.mapped` has them, computed once for each change."""
        if self._mapped is None or self._mapped[0] is not metric:
            self._mapped = metric, metric.mapped(self.views)
        return self._mapped[1]


def nearest_views(
    galleries: Sequence[Gallery], seen: FloatArray, metric: Metric
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Distance (N, M) of descriptors (M, D) to the nearest view of each gallery, and which it is.

    Of an empty gallery the distance is 1 and the view 0.
    """
    found: FloatArray = np.ones((len(galleries), len(seen)))
    which: NDArray[np.intp] = np.zeros(found.shape, np.intp)
    filled = [k for k, gallery in enumerate(galleries) if len(gallery.views)]
    if filled and len(seen):
        views = [galleries[k].mapped(metric) for k in filled]
        distance = metric.distances(np.concatenate(views), metric.mapped(seen))
        start = 0
        for k, some in zip(filled, views, strict=True):
            own = distance[start : start + len(some)]
            which[k] = own.argmin(axis=0)
            found[k] = own.min(axis=0)
            start += len(some)
    return found, which
