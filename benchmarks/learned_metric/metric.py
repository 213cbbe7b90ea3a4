"""Metric of appearance learned from the scene: what varies within one person counts less.

Within-class covariance normalisation (A. Hatch 2006): squares of differences of descriptors are
divided by the variance that looks of one person have in the same direction. A pose, a shadow or the
background beside a person varies within that person; clothes do not.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from heel.services.tracker.people.appearance import DESCRIPTOR_LENGTH, FloatArray

_COMPONENTS = 80
"""Principal directions of all differences, whose variance within people is learned; chosen by
hand."""
_UNSEEN = 0.05
"""Weight of all other directions, share of that of one that never varies within a person: there is
noise, but also clothes that nobody has worn so far; chosen by hand."""
_SHRINKAGE = 0.3
"""Least share of an even variance in the covariance within people; chosen by hand."""
_EVEN_SAMPLES = 100.0
"""Differences from which the covariance counts as much as an even variance; chosen by hand."""
_LEAST_SAMPLES = 40
"""Differences within people, and between, from which a metric is learned; chosen by hand."""
_FIRST_ITERATIONS = 3
"""Of the orthogonal iteration for the directions; later it goes on from the last ones."""

Samples = NDArray[np.float32]
"""(N, D) differences of descriptors."""


@dataclass(frozen=True, eq=False)
class Metric:
    """Distances of descriptors, Hellinger's or learned: a difference's square, and of some parts.

    Attributes:
        scale: factor on distances.
        parts: (D, K) directions, each as long as it is to count more or less than others.
        signs: (D + K,) 1 for what is added, -1 for what is taken off.
        directions: (D, K) orthonormal, from which the next metric is learned faster.
    """

    scale: float = 0.5**0.5
    parts: FloatArray | None = None
    signs: FloatArray = field(default_factory=lambda: np.ones(DESCRIPTOR_LENGTH))
    directions: FloatArray | None = None

    def mapped(self, looks: FloatArray) -> FloatArray:
        """Descriptors (N, D), or their differences, as this metric compares them."""
        return looks if self.parts is None else np.concatenate([looks, looks @ self.parts], axis=1)

    def lengths(self, differences: FloatArray) -> FloatArray:
        """Of differences of descriptors (N, D): (N,)."""
        squares = self.mapped(differences) ** 2 @ self.signs
        return np.asarray(self.scale * np.sqrt(np.maximum(squares, 0.0)))

    def distances(self, first: FloatArray, second: FloatArray) -> FloatArray:
        """Distances (N, M) of mapped descriptors (N, ...) and (M, ...)."""
        squares = (first**2 @ self.signs)[:, None] + (second**2 @ self.signs)[None]
        squares -= 2 * (first * self.signs) @ second.T
        return np.asarray(self.scale * np.sqrt(np.maximum(squares, 0.0)))


class Learned(NamedTuple):
    """A metric, and the lengths of differences that it was not learned from.

    Attributes:
        metric: learned from all samples.
        same: (N,) lengths of differences within people, each in a metric learned from the half of
            the samples that it is not in: those it is in would be too short.
        other: (M,) the same between people.
    """

    metric: Metric
    same: FloatArray
    other: FloatArray


def learned(before: Metric, same: Samples, other: Samples) -> Learned:
    """The metric of a scene, in which looks of one person are as far apart as in Hellinger's.

    Args:
        before: the metric so far, kept while there are too few samples.
        same: (N, D) differences of descriptors of one person.
        other: (M, D) those of descriptors of two people in one frame.
    """
    count = len(same)
    differences = np.concatenate([same, other])
    squares = np.einsum("ij,ij->i", differences, differences).astype(np.float64)
    if min(count, len(other)) < _LEAST_SAMPLES:
        lengths = before.lengths(differences.astype(np.float64))
        return Learned(before, lengths[:count], lengths[count:])
    basis = _directions(before.directions, differences)
    inside = (differences @ basis.astype(np.float32)).astype(np.float64)
    outside = np.maximum(squares - (inside**2).sum(axis=1), 0.0)
    taught = np.zeros((2, len(inside)), bool)
    taught[0, : count // 2] = taught[1, count // 2 : count] = True
    asked = ~taught
    asked[0, count : count + len(other) // 2] = asked[1, count + len(other) // 2 :] = False
    found = np.zeros(len(inside))
    for some, others in zip(taught, asked, strict=True):
        found[others] = _variation(inside[some]).lengths(inside[others], outside[others])
    # Scaled so that thresholds and priors in Hellinger's unit keep their meaning.
    scale = float(np.sqrt(0.5 * squares[:count]).mean()) / max(float(found[:count].mean()), 1e-9)
    metric = _variation(inside[:count]).metric(basis, scale)
    return Learned(metric, found[:count] * scale, found[count:] * scale)


def _directions(before: FloatArray | None, samples: Samples) -> FloatArray:
    """The directions (D, K) of the largest variation, by orthogonal iteration."""
    basis, iterations = before, 1
    if basis is None:
        iterations = _FIRST_ITERATIONS
        basis = np.random.default_rng(0).standard_normal((DESCRIPTOR_LENGTH, _COMPONENTS))
    for _ in range(iterations):
        turned = samples.T @ (samples @ basis.astype(np.float32))
        basis = np.linalg.qr(turned.astype(np.float64))[0]
    return np.asarray(basis)


@dataclass(frozen=True, eq=False)
class _Variation:
    """What differences within people weigh: along axes (K, K) of a basis, and outside of it."""

    axes: FloatArray
    weights: FloatArray
    outside: float

    def lengths(self, inside: FloatArray, outside: FloatArray) -> FloatArray:
        """Of differences: (N, K) in the basis, and the squares (N,) of what lies outside."""
        squares = (inside @ self.axes) ** 2 @ self.weights
        return np.asarray(np.sqrt(squares + self.outside * outside))

    def metric(self, basis: FloatArray, scale: float) -> Metric:
        """Of descriptors, in a basis (D, K)."""
        more = self.weights / self.outside - 1
        signs = np.concatenate([np.ones(DESCRIPTOR_LENGTH), np.sign(more)])
        parts = basis @ (self.axes * np.sqrt(np.abs(more)))
        return Metric(scale * float(np.sqrt(self.outside)), parts, signs, basis)


def _variation(within: FloatArray) -> _Variation:
    """Of differences within people (N, K) in a basis: they are to vary evenly."""
    variances, axes = np.linalg.eigh(within.T @ within / len(within))
    even = max(_SHRINKAGE, _EVEN_SAMPLES / (_EVEN_SAMPLES + len(within)))
    flat = even * float(variances.mean()) + 1e-9
    weights = 1 / ((1 - even) * np.maximum(variances, 0.0) + flat)
    return _Variation(axes, weights, _UNSEEN / flat)
