"""Likelihood ratio of appearance: distances of descriptors to log odds of being the same person.

The distances between descriptors of one person and of two people depend on the scene, so both
distributions are learned from the scene itself: a track that is seen alone gives distances of the
same person, two tracks in one frame those of two people.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from heel.services.tracker.people.appearance import DESCRIPTOR_LENGTH, distances
from heel.services.tracker.people.geometry import FloatArray

_PRIOR_SAMPLES = 30.0
"""Weight of the prior distributions [samples]; chosen by hand."""
_MOST_SAMPLES = 2000.0
"""Memory of distances [samples]: a minute or two of a group; chosen by hand."""
_LEAST_LOOKS = 3
"""Descriptors from which a gallery is compared; chosen by hand."""
_WEIGHT = 0.7
"""Weight of the log odds of colours, below 1 as neighbouring frames have the same light; chosen by
hand."""
_MOST = 6.0
"""Most log odds that colours can give; chosen by hand."""
MOST_AGAINST = 12.0
"""Most log odds that colours can take; chosen by hand."""
_LEAST_SPREAD = 0.05
"""Least standard deviation of distances: the resolution of the histograms; chosen by hand."""
_MEMORY = 0.03
"""Least share of a new descriptor in the mean of a view; chosen by hand."""
_MOST_VIEWS = 5
"""Most views in a gallery: front, back, two sides and one more; chosen by hand."""
_NEW_VIEW = 0.4
"""Distance to all views from which a descriptor becomes a view of its own; chosen by hand."""


class Gallery:
    """Descriptors of one person: a few views that differ, each a slow mean of those near it."""

    def __init__(self) -> None:
        self.views = np.zeros((0, DESCRIPTOR_LENGTH))
        self.looks = 0
        self._counts: list[int] = []

    def copy(self) -> Gallery:
        """A copy of the gallery, which later descriptors do not change."""
        other = Gallery()
        other.views, other.looks, other._counts = self.views, self.looks, list(self._counts)
        return other

    def newest(self) -> FloatArray:
        """The view (D,) that was added last; zeros for an empty gallery."""
        return np.asarray(self.views[-1] if len(self.views) else np.zeros(DESCRIPTOR_LENGTH))

    def add(self, look: FloatArray) -> None:
        """Take in a (D,) descriptor of the person seen alone."""
        self.looks += 1
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


class LookStatistics:
    """Running mean and variance of distances, started from a prior worth some samples."""

    def __init__(self, mean: float, spread: float) -> None:
        self.mean = mean
        self._square = mean**2 + spread**2
        self._weight = _PRIOR_SAMPLES

    def learn(self, values: FloatArray) -> None:
        """Take more distances, (N,); old ones fade from `_MOST_SAMPLES` on."""
        if len(values) == 0:
            return
        self._weight = min(self._weight + len(values), _MOST_SAMPLES)
        self.mean += float((values - self.mean).sum()) / self._weight
        self._square += float((values**2 - self._square).sum()) / self._weight

    def log_density(self, value: FloatArray, floor: float) -> FloatArray:
        """Log of the normal density at `value`, less a constant; deviation not below `floor`."""
        variance = max(self._square - self.mean**2, floor**2)
        return np.asarray(-0.5 * ((value - self.mean) ** 2 / variance + np.log(variance)))


class LookModel:
    """Turns distances of descriptors into log odds of being the same person."""

    def __init__(self) -> None:
        """Start from the priors."""
        self._same = LookStatistics(0.25, 0.08)
        self._other = LookStatistics(0.5, 0.12)

    def compare(self, galleries: Sequence[Gallery], looks: FloatArray) -> FloatArray:
        """Log odds (N, M) that (M, D) descriptors are of the galleries' people.

        They are 0 for galleries of fewer than `_LEAST_LOOKS` descriptors.
        """
        known = np.array([gallery.looks >= _LEAST_LOOKS for gallery in galleries], bool)
        odds = self.log_odds(nearest_views(galleries, looks))
        return np.asarray(np.where(known[:, None], odds, 0.0))

    def learn(self, galleries: Sequence[Gallery], looks: FloatArray) -> None:
        """Learn from (N, D) descriptors of people seen alone in one frame, and their galleries."""
        distance = nearest_views(galleries, looks)
        same = np.eye(len(looks), dtype=bool)
        self._same.learn(distance[same])
        self._other.learn(distance[~same])

    def log_odds(self, distance: FloatArray) -> FloatArray:
        """Log odds, same shape as `distance`, in [-`MOST_AGAINST`, `_MOST`]."""
        floor = _LEAST_SPREAD
        odds = self._same.log_density(distance, floor) - self._other.log_density(distance, floor)
        # Both normal densities are monotone only between their means.
        odds = np.where(distance < self._same.mean, np.maximum(odds, 0.0), odds)
        odds = np.where(distance > self._other.mean, np.minimum(odds, 0.0), odds)
        return np.asarray(np.clip(_WEIGHT * odds, -MOST_AGAINST, _MOST))


def nearest_views(galleries: Sequence[Gallery], looks: FloatArray) -> FloatArray:
    """Distance (N, M) of (M, D) descriptors to the nearest view of each gallery; 1 if empty."""
    found = np.ones((len(galleries), len(looks)))
    filled: NDArray[np.intp] = np.array(
        [k for k, gallery in enumerate(galleries) if len(gallery.views)], np.intp
    )
    if len(filled) and len(looks):
        views = [galleries[k].views for k in filled]
        starts = np.cumsum([0, *(len(some) for some in views[:-1])])
        distance = distances(np.concatenate(views), looks)
        found[filled] = np.minimum.reduceat(distance, starts, axis=0)
    return found
