"""Metric of appearance learned from the scene: what varies within one person counts less.

Within-class covariance normalisation (A. Hatch 2006): differences of descriptors are divided by the
covariance of those between looks of one person, in the principal components of all differences. A
pose, a shadow or the background beside a person varies within that person; clothes do not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.services.tracker.appearance.descriptor import DESCRIPTOR_LENGTH, FloatArray

_COMPONENTS = 80
"""Principal components that are kept; with 40 to 120 the order of people hardly changes."""
_SHRINKAGE = 0.3
"""Least share of an even variance in the covariance within people; chosen by hand."""
_EVEN_SAMPLES = 100.0
"""Differences from which the covariance counts as much as an even variance; chosen by hand."""
_LEAST_SAMPLES = 40
"""Differences within people, and between, from which a metric is learned; chosen by hand."""
_FIRST_ITERATIONS = 3
"""Of the orthogonal iteration for the principal components; later it goes on from the last ones."""

Samples = NDArray[np.float32]
"""(N, D) differences of descriptors."""


@dataclass(frozen=True, eq=False)
class Metric:
    """A linear map of descriptors, in whose image Euclidean distances are the learned ones.

    Attributes:
        matrix: (D, K); None for the Hellinger distance of descriptors as they are.
        components: (D, K) orthonormal, from which the next metric is learned faster.
    """

    matrix: FloatArray | None = None
    components: FloatArray | None = None

    def mapped(self, looks: FloatArray) -> FloatArray:
        """Descriptors (N, D) or their differences as points (N, K)."""
        return np.asarray(looks * 0.5**0.5 if self.matrix is None else looks @ self.matrix)

    def distances(self, first: FloatArray, second: FloatArray) -> FloatArray:
        """Distances (N, M) of mapped points (N, K) and (M, K)."""
        squares = (first**2).sum(axis=1)[:, None] + (second**2).sum(axis=1)[None]
        return np.asarray(np.sqrt(np.maximum(squares - 2 * first @ second.T, 0.0)))


def learned_metric(before: Metric, same: Samples, other: Samples) -> Metric:
    """The metric of a scene, in which looks of one person are as far apart as in Hellinger's.

    Args:
        before: the metric so far, returned again while there are too few samples.
        same: (N, D) differences of descriptors of one person.
        other: (M, D) those of descriptors of two people in one frame.
    """
    if min(len(same), len(other)) < _LEAST_SAMPLES:
        return before
    basis, iterations = before.components, 1
    if basis is None:
        iterations = _FIRST_ITERATIONS
        rng = np.random.default_rng(0)
        basis = rng.standard_normal((DESCRIPTOR_LENGTH, _COMPONENTS))
    within = same.astype(np.float32, copy=False)
    all_samples = np.concatenate([within, other])
    for _ in range(iterations):
        turned = all_samples.T @ (all_samples @ basis.astype(np.float32))
        basis = np.linalg.qr(turned.astype(np.float64))[0]
    inside = (within @ basis.astype(np.float32)).astype(np.float64)
    covariance = inside.T @ inside / len(inside)
    even = max(_SHRINKAGE, _EVEN_SAMPLES / (_EVEN_SAMPLES + len(inside)))
    variance = np.trace(covariance) / _COMPONENTS + 1e-9
    covariance = (1 - even) * covariance + even * variance * np.eye(_COMPONENTS)
    whitening = np.linalg.inv(np.linalg.cholesky(covariance)).T
    # Scaled so that thresholds and priors in Hellinger's unit keep their meaning.
    usual = np.sqrt((within.astype(np.float64) ** 2).sum(axis=1) / 2).mean()
    now = np.linalg.norm(inside @ whitening, axis=1).mean()
    return Metric(basis @ whitening * (usual / max(now, 1e-9)), basis)
