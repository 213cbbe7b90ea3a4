"""Likelihood ratio of appearance: distances of descriptors to log odds of being the same person.

Metric and distributions depend on the scene, so both are learned from the scene itself: a track
that is seen alone gives differences of the same person, two tracks in one frame those of two.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.learned_metric.gallery import Gallery, nearest_views
from benchmarks.learned_metric.metric import Metric, Samples, learned
from heel.services.tracker.people.appearance import DESCRIPTOR_LENGTH, FloatArray

_PRIOR_SAMPLES = 30.0
"""Weight of the prior distributions [samples]; chosen by hand."""
_SAME = (0.25, 0.08)
"""Prior mean and standard deviation of distances of one person; chosen by hand."""
_OTHER = (0.5, 0.12)
"""The same of two people."""
_MOST_SAMPLES = 512
"""Differences of each kind that are kept; 20 s of six people. Chosen by hand for time."""
_SAMPLE_EVERY_S = 0.25
"""Time between differences that are kept, once half of those are there [s]: neighbouring frames are
alike, but at first they are all there is. Chosen by hand."""
_REFRESH_S = 3.0
"""Time between two metrics [s]; chosen by hand."""
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
_EPSILON_S = 1e-6
"""Slack of comparisons of times [s], below any frame's."""


class _Differences:
    """The last differences of descriptors of one kind, and the normal density of their lengths."""

    def __init__(self, prior: tuple[float, float]) -> None:
        self._prior = prior
        self.mean, self.spread = prior
        self._samples: Samples = np.zeros((_MOST_SAMPLES, DESCRIPTOR_LENGTH), np.float32)
        self._count = 0

    def add(self, differences: FloatArray) -> None:
        """Take (N, D) more in, in the place of the oldest."""
        places = (self._count + np.arange(len(differences))) % _MOST_SAMPLES
        self._samples[places] = differences
        self._count += len(differences)

    def samples(self) -> Samples:
        """Those kept, (N, D)."""
        return self._samples[: min(self._count, _MOST_SAMPLES)]

    def fit(self, lengths: FloatArray) -> None:
        """Fit the density to lengths (N,), with the prior worth some samples."""
        mean, spread = self._prior
        weight = _PRIOR_SAMPLES + len(lengths)
        square = (_PRIOR_SAMPLES * (mean**2 + spread**2) + float((lengths**2).sum())) / weight
        self.mean = (_PRIOR_SAMPLES * mean + float(lengths.sum())) / weight
        self.spread = max(square - self.mean**2, _LEAST_SPREAD**2) ** 0.5

    def log_density(self, lengths: FloatArray) -> FloatArray:
        """Log of the normal density, less a constant."""
        density = -0.5 * ((lengths - self.mean) / self.spread) ** 2
        return np.asarray(density - np.log(self.spread))


class AppearanceModel:
    """Turns distances of descriptors into log odds of being the same person.

    Usage:
        odds = model.compare(galleries, looks)
        model.learn(galleries, looks, t_s)  # people seen alone
        model.settle(t_s)  # once the frame's tracks are on their way
    """

    def __init__(self) -> None:
        """Start from the priors, and Hellinger distances."""
        self.metric = Metric()
        self._same = _Differences(_SAME)
        self._other = _Differences(_OTHER)
        self._turn = 0
        self._sampled_s = self._refreshed_s = -np.inf

    def compare(self, galleries: Sequence[Gallery], looks: FloatArray) -> FloatArray:
        """Log odds (N, M) that (M, D) descriptors are of the galleries' people.

        They are 0 for galleries of fewer than `_LEAST_LOOKS` descriptors.
        """
        known: NDArray[np.bool_] = np.array(
            [each.looks >= _LEAST_LOOKS for each in galleries], bool
        )
        odds = self.log_odds(nearest_views(galleries, looks, self.metric)[0])
        return np.asarray(np.where(known[:, None], odds, 0.0))

    def learn(self, galleries: Sequence[Gallery], looks: FloatArray, t_s: float) -> None:
        """Learn from (N, D) descriptors of people seen alone in one frame, and their galleries.

        Args:
            galleries: of these people, none empty, before the descriptors are added.
            looks: one of each.
            t_s: time of the frame.
        """
        few = len(self._same.samples()) < _MOST_SAMPLES // 2
        wait_s = 0.0 if few else _SAMPLE_EVERY_S
        if not len(looks) or t_s < self._sampled_s + wait_s - _EPSILON_S:
            return
        self._sampled_s = t_s
        nearest = nearest_views(galleries, looks, self.metric)[1]
        # Each is compared with one of the others, in turns: as many as there are of the same.
        count = len(looks)
        self._turn += 1
        own = np.arange(count)
        other = (own + 1 + self._turn % max(count - 1, 1)) % count
        for kept, whom in ((self._same, own), (self._other, other)):
            if kept is self._same or count > 1:
                views = [galleries[k].views[nearest[k, j]] for j, k in enumerate(whom.tolist())]
                kept.add(looks - np.array(views))

    def settle(self, t_s: float) -> None:
        """Learn the metric again, if it is time; no frame's tracks wait for it."""
        wait_s = 0.0 if self.metric.parts is None else _REFRESH_S
        if t_s < self._refreshed_s + wait_s or self._sampled_s <= self._refreshed_s:
            return
        self._refreshed_s = t_s
        self.metric, same, other = learned(self.metric, self._same.samples(), self._other.samples())
        self._same.fit(same)
        self._other.fit(other)

    def log_odds(self, distance: FloatArray) -> FloatArray:
        """Log odds, same shape as `distance`, in [-`MOST_AGAINST`, `_MOST`]."""
        odds = self._same.log_density(distance) - self._other.log_density(distance)
        # Both normal densities are monotone only between their means.
        odds = np.where(distance < self._same.mean, np.maximum(odds, 0.0), odds)
        odds = np.where(distance > self._other.mean, np.minimum(odds, 0.0), odds)
        return np.asarray(np.clip(_WEIGHT * odds, -MOST_AGAINST, _MOST))
