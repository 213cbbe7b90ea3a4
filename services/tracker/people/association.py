"""Association of boxes and tracks: log likelihood ratios, Kuhn-Munkres, marginal probabilities.

A pair's weight is the log of the odds that the box comes from the track rather than from a
newcomer or a false alarm, so gate and refusal are one rule: a track whose predicted variance has
grown large loses to `_NEWCOMER_DENSITY` by itself.
"""

from __future__ import annotations

import math

import numpy as np

from heel.services.geometry.assignment import heaviest_pairs
from heel.services.tracker.people.geometry import AXES, FloatArray
from heel.services.tracker.people.kalman import (
    ASPECT_MEAN,
    ASPECT_SPREAD,
    NOISE_ASPECT,
    measurement_variance,
)

REFUSED = -1e6
"""Log odds of a pair that is not allowed: far below those of any other."""
_TAIL = 7.0
"""Degrees of freedom of the Student t likelihood of a box; chosen by hand."""
GATE = 5.5
"""Largest normalised distance of a box to a track [sigmas]; beyond the tails of any detector;
chosen by hand."""
_NEWCOMER_DENSITY = 0.6
"""Expected unexplained boxes per square height of image; chosen by hand."""
_HEIGHT_SPREAD = 0.5
"""Standard deviation of ln(height) among people of one scene; chosen by hand."""


def log_student(residual: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Log density of residuals under a Student t of the given variances, and their distance.

    Heavy tails, because detectors' boxes jump when people overlap.

    Args:
        residual: (N, M, 4).
        variance: (N, 1, 4) or (N, M, 4), same units squared, > 0.

    Returns:
        Log density (N, M) and Mahalanobis distance (N, M) in sigmas.
    """
    squared = (residual**2 / variance).sum(axis=2)
    norm = math.lgamma((_TAIL + AXES) / 2) - math.lgamma(_TAIL / 2)
    norm -= AXES / 2 * math.log((_TAIL - 2) * math.pi)
    density = norm - 0.5 * np.log(variance).sum(axis=2)
    density = density - (_TAIL + AXES) / 2 * np.log1p(squared / (_TAIL - 2))
    return density, np.sqrt(squared)


def in_heights(heights: FloatArray) -> FloatArray:
    """Unit (N, 4) of each axis: the person's height for the centre, 1 for the logarithms."""
    scale = np.ones((len(heights), AXES))
    scale[:, :2] = heights[:, None]
    return scale


def newcomer_log_density(measurements: FloatArray) -> FloatArray:
    """Log density (M,) of a box of no known person, per squared height and logarithms of sizes."""
    aspect = measurements[:, 3] - math.log(ASPECT_MEAN)
    variance = ASPECT_SPREAD**2 + NOISE_ASPECT**2
    # A newcomer's height is distributed as people's in one scene: the mean log density of a normal.
    height = -0.5 * math.log(2 * math.pi) - math.log(_HEIGHT_SPREAD) - 0.5
    aspects = -0.5 * math.log(2 * math.pi * variance) - 0.5 * aspect**2 / variance
    return np.asarray(math.log(_NEWCOMER_DENSITY) + height + aspects)


def pair_log_odds(
    mean: FloatArray,
    covariance: FloatArray,
    rates: FloatArray,
    measurements: FloatArray,
    noise: FloatArray,
) -> FloatArray:
    """Log odds (N, M) that a box is of a track, against leaving both unpaired.

    Args:
        mean: (N, 4, 2) and covariance: (N, 4, 2, 2), predicted, see `kalman`.
        rates: (N,) chance in (0, 1) of each track to be real and to get a box.
        measurements: (M, 4) boxes as of `geometry.boxes_to_measurements`.
        noise: (M,) factor on the variance of each box.
    """
    value = mean[:, :, 0]
    scale = in_heights(np.exp(value[:, 2]))
    measured = noise[None, :, None] * measurement_variance(value)[:, None]
    variance = (covariance[:, None, :, 0, 0] + measured) / scale[:, None] ** 2
    residual = (measurements[None] - value[:, None]) / scale[:, None]
    density, distance = log_student(residual, variance)
    prior = np.log(rates) - np.log1p(-rates)
    odds = density + prior[:, None] - newcomer_log_density(measurements)[None]
    return np.asarray(np.where(distance > GATE, REFUSED, odds))


def assign(log_odds: FloatArray) -> list[tuple[int, int]]:
    """Pairs (track, box) of the most probable assignment (Kuhn-Munkres).

    Args:
        log_odds: (N, M) log odds of each pair against leaving both unpaired; only pairs above zero
            are worth making.
    """
    if log_odds.size == 0:
        return []
    rows, columns = heaviest_pairs(np.maximum(log_odds, 0.0), above=0.0)
    return list(zip(rows.tolist(), columns.tolist(), strict=True))


def marginals(log_odds: FloatArray, iterations: int = 12) -> FloatArray:
    """Probability (N, M) that each box belongs to each track, over all assignments at once.

    Belief propagation of Williams & Lau, "Approximate evaluation of marginal association
    probabilities with belief propagation", IEEE T-AES 50(4), 2014.
    """
    weight = np.exp(np.clip(log_odds, -50.0, 50.0))
    to_track = np.ones_like(weight)
    # Sums over all but one; total less the one cancels to 0 where that one is 1e16 times the rest.
    other_tracks, other_boxes = (1.0 - np.eye(count) for count in weight.shape)
    for _ in range(iterations):
        to_box = weight / (1.0 + (weight * to_track) @ other_boxes)
        to_track = 1.0 / (1.0 + other_tracks @ to_box)
    product = weight * to_track
    return np.asarray(product / (1.0 + product.sum(axis=1, keepdims=True)))
