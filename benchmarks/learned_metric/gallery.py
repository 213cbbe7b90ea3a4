"""Gallery of one person: a few appearance descriptors that differ, and their distances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.learned_metric.metric import Metric
from heel.services.tracker.people.appearance import (
    DESCRIPTOR_LENGTH,
    FloatArray,
    distances,
)

_MEMORY = 0.03
"""Least share of a new descriptor in the mean of a view; chosen by hand."""
_MOST_VIEWS = 5
"""Most views in a gallery: front, back, two sides and one more; chosen by hand."""
_NEW_VIEW = 0.4
"""Hellinger distance to all views from which a descriptor becomes a view of its own; chosen by
hand."""


class Gallery:
    """Descriptors of one person: a few views that differ, each a slow mean of those near it.

    Attributes:
        views: (V, D), at most five, of unit length.
        looks: descriptors that were added.
    """

    def __init__(self) -> None:
        self.views: FloatArray = np.zeros((0, DESCRIPTOR_LENGTH))
        self.looks = 0
        self._counts: list[int] = []
        self._mapped: tuple[Metric, FloatArray] | None = None

    def copy(self) -> Gallery:
        """A copy of the gallery, which later descriptors do not change."""
        other = Gallery()
        other.views, other.looks, other._counts = self.views, self.looks, list(self._counts)
        other._mapped = self._mapped
        return other

    def newest(self) -> FloatArray:
        """The view (D,) that was added last; zeros for an empty gallery."""
        return np.asarray(self.views[-1] if len(self.views) else np.zeros(DESCRIPTOR_LENGTH))

    def add(self, look: FloatArray) -> None:
        """Take in a (D,) descriptor of the person seen alone."""
        self.looks += 1
        self._mapped = None
        if len(self.views):
            distance = distances(self.views, look[None])[:, 0]
            nearest = int(distance.argmin())
            if distance[nearest] < _NEW_VIEW or len(self.views) >= _MOST_VIEWS:
                blend = max(_MEMORY, 1 / (self._counts[nearest] + 1))
                mixed = self.views[nearest] + blend * (look - self.views[nearest])
                views = self.views.copy()
                views[nearest] = mixed / np.linalg.norm(mixed)
                self.views = views
                self._counts[nearest] += 1
                return
        self.views = np.concatenate([self.views, look[None]])
        self._counts.append(1)

    def mapped(self, metric: Metric) -> FloatArray:
        """The views (V, K) as `metric.mapped` has them, computed once for each change."""
        if self._mapped is None or self._mapped[0] is not metric:
            self._mapped = metric, metric.mapped(self.views)
        return self._mapped[1]


def nearest_views(
    galleries: Sequence[Gallery], looks: FloatArray, metric: Metric
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Distance (N, M) of (M, D) descriptors to the nearest view of each gallery, and which it is.

    Of an empty gallery the distance is 1 and the view 0.
    """
    found: FloatArray = np.ones((len(galleries), len(looks)))
    which: NDArray[np.intp] = np.zeros(found.shape, np.intp)
    filled = [k for k, gallery in enumerate(galleries) if len(gallery.views)]
    if filled and len(looks):
        views = [galleries[k].mapped(metric) for k in filled]
        distance = metric.distances(np.concatenate(views), metric.mapped(looks))
        start = 0
        for k, some in zip(filled, views, strict=True):
            own = distance[start : start + len(some)]
            which[k] = own.argmin(axis=0)
            found[k] = own.min(axis=0)
            start += len(some)
    return found, which
