"""Kalman filter of person boxes, for all tracks at once.

The paper's state is `[Cx, Cy, A, s, dCx, dCy, dA, ds]`: centre, area, span and their rates. Here
area and span are replaced by the logarithms of height and aspect ratio (see
`geometry.boxes_to_measurements`), which makes the four axes independent. So the 8 x 8 filter falls
apart into four filters of two states (value, rate) with closed forms, and each noise is one number
for near and far people: lengths are fractions of the person's height, times are seconds.

The aspect ratio has no rate: it is an Ornstein-Uhlenbeck process about that of a standing person.
"""

from __future__ import annotations

import numpy as np

from heel.services.tracker.people.geometry import AXES, FloatArray

ASPECT = 3
"""Index of the axis without a rate."""
UNKNOWN = 1e12
"""Variance, and variance factor, of an axis that was not measured: above any other."""

# Motion of people and scatter of detectors' boxes about them; lengths in person heights.
# Fitted by hand to the boxes of public detectors (see docs on association).
NOISE_X = 0.035
"""Standard deviation of a box's centre x [heights]."""
NOISE_Y = 0.043
"""Standard deviation of a box's centre y [heights]."""
NOISE_HEIGHT = 0.085
"""Standard deviation of ln(box height)."""
NOISE_ASPECT = 0.13
"""Standard deviation of ln(box width / height)."""
_ACCELERATION_X = 0.8
"""White sideways acceleration [heights / s^1.5], so that people may change pace within a second."""
_ACCELERATION_Y = 0.25
"""White vertical acceleration [heights / s^1.5], small as the ground is foreshortened."""
_ACCELERATION_GROWTH = 0.5
"""White acceleration of ln(height) [1 / s^1.5]."""
INITIAL_SPEED_X = 1.1
"""Standard deviation of a new track's sideways speed [heights/s]: a brisk walk."""
INITIAL_SPEED_Y = 0.25
"""Standard deviation of a new track's vertical speed [heights/s]."""
_INITIAL_GROWTH = 0.2
"""Standard deviation of a new track's rate of ln(height) [1/s]."""
_SPEED_MEMORY_S = 2.5
"""Time constant of the decay of speed without a box [s]; chosen by hand."""
_GROWTH_MEMORY_S = 0.3
"""Time constant of the decay of growth without a box [s]: short, as heights of boxes oscillate."""
ASPECT_MEAN = 0.39
"""Width by height of the box of a standing person."""
ASPECT_SPREAD = 0.22
"""Standard deviation of ln(width / height) of people."""
_ASPECT_MEMORY_S = 1.2
"""Time constant of a person's width by height [s]: about two steps."""


def initial_state(measurements: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Start a filter from one box each.

    Args:
        measurements: (N, 4) rows as of `boxes_to_measurements`.

    Returns:
        Mean (N, 4, 2) and covariance (N, 4, 2, 2): per axis the value and its rate per second.
    """
    count = len(measurements)
    mean = np.zeros((count, AXES, 2))
    mean[:, :, 0] = measurements
    covariance = np.zeros((count, AXES, 2, 2))
    covariance[:, :, 0, 0] = measurement_variance(measurements)
    height_px = np.exp(measurements[:, 2])
    covariance[:, 0, 1, 1] = (INITIAL_SPEED_X * height_px) ** 2
    covariance[:, 1, 1, 1] = (INITIAL_SPEED_Y * height_px) ** 2
    covariance[:, 2, 1, 1] = _INITIAL_GROWTH**2
    # The first box is blended with the prior of standing people.
    prior = ASPECT_SPREAD**2
    gain = prior / (prior + covariance[:, ASPECT, 0, 0])
    mean[:, ASPECT, 0] += (1 - gain) * (np.log(ASPECT_MEAN) - measurements[:, ASPECT])
    covariance[:, ASPECT, 0, 0] *= gain
    return mean, covariance


def measurement_variance(measurements: FloatArray) -> FloatArray:
    """Variance (N, 4) of a detector's box about the person: px^2, px^2, and squared logarithms."""
    height_px = np.exp(measurements[:, 2])
    ones = np.ones_like(height_px)
    return np.stack(
        [
            (NOISE_X * height_px) ** 2,
            (NOISE_Y * height_px) ** 2,
            NOISE_HEIGHT**2 * ones,
            NOISE_ASPECT**2 * ones,
        ],
        axis=1,
    )


def predict(
    mean: FloatArray, covariance: FloatArray, elapsed_s: float
) -> tuple[FloatArray, FloatArray]:
    """Move all filters `elapsed_s` seconds on; arrays as returned by `initial_state`."""
    height_px = np.exp(mean[:, 2, 0])
    mean, covariance = mean.copy(), covariance.copy()
    noise = np.zeros((len(mean), ASPECT))
    noise[:, 0] = (_ACCELERATION_X * height_px) ** 2
    noise[:, 1] = (_ACCELERATION_Y * height_px) ** 2
    noise[:, 2] = _ACCELERATION_GROWTH**2
    decay_s = np.array([_SPEED_MEMORY_S, _SPEED_MEMORY_S, _GROWTH_MEMORY_S])
    keep = np.exp(-elapsed_s / decay_s)
    reach = decay_s * (1 - keep)
    value, rate = mean[:, :ASPECT, 0], mean[:, :ASPECT, 1]
    mean[:, :ASPECT, 0] = value + reach * rate
    mean[:, :ASPECT, 1] = keep * rate
    p00, p01, p11 = (
        covariance[:, :ASPECT, 0, 0],
        covariance[:, :ASPECT, 0, 1],
        covariance[:, :ASPECT, 1, 1],
    )
    new00 = p00 + 2 * reach * p01 + reach**2 * p11 + noise * elapsed_s**3 / 3
    new01 = keep * (p01 + reach * p11) + noise * elapsed_s**2 / 2
    new11 = keep**2 * p11 + noise * elapsed_s
    covariance[:, :ASPECT, 0, 0] = new00
    covariance[:, :ASPECT, 0, 1] = covariance[:, :ASPECT, 1, 0] = new01
    covariance[:, :ASPECT, 1, 1] = new11
    stay = np.exp(-elapsed_s / _ASPECT_MEMORY_S)
    centre = np.log(ASPECT_MEAN)
    mean[:, ASPECT, 0] = centre + stay * (mean[:, ASPECT, 0] - centre)
    spread = ASPECT_SPREAD**2
    covariance[:, ASPECT, 0, 0] = spread + stay**2 * (covariance[:, ASPECT, 0, 0] - spread)
    return mean, covariance


def update(
    mean: FloatArray, covariance: FloatArray, measurements: FloatArray, variance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Correct all filters by one box each.

    Args:
        mean: (N, 4, 2), covariance: (N, 4, 2, 2), as predicted.
        measurements: (N, 4).
        variance: (N, 4) measurement variance, > 0.
    """
    innovation = measurements - mean[:, :, 0]
    gain = covariance[:, :, :, 0] / (covariance[:, :, 0, 0] + variance)[:, :, None]
    corrected = mean + gain * innovation[:, :, None]
    return corrected, covariance - gain[:, :, :, None] * covariance[:, :, None, 0, :]
