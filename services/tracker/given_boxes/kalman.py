"""Kalman filter of person boxes, for all tracks at once.

The paper's state is `[Cx, Cy, A, s, dCx, dCy, dA, ds]`: centre, area, span and their rates. Here
area and span are replaced by the logarithms of height and aspect ratio (see
`geometry.boxes_to_measurements`), which makes the four axes independent, so the 8 x 8 filter falls
apart into four filters of two states (value, rate) with closed forms, and lets every noise be
stated once for near and far people: lengths are fractions of the person's height, times are
seconds.

The aspect ratio has no rate: it wanders about that of a standing person (Ornstein-Uhlenbeck).
"""

from __future__ import annotations

import numpy as np

from heel.services.tracker.given_boxes.geometry import AXES, FloatArray
from heel.services.tracker.given_boxes.settings import MotionSettings

ASPECT = 3


def initial_state(
    measurements: FloatArray, settings: MotionSettings
) -> tuple[FloatArray, FloatArray]:
    """Start a filter from one box each.

    Args:
        measurements: (N, 4) rows as of `boxes_to_measurements`.
        settings: noises.

    Returns:
        Mean (N, 4, 2) and covariance (N, 4, 2, 2): per axis the value and its rate per second.
    """
    count = len(measurements)
    mean = np.zeros((count, AXES, 2))
    mean[:, :, 0] = measurements
    covariance = np.zeros((count, AXES, 2, 2))
    covariance[:, :, 0, 0] = measurement_variance(measurements, settings)
    height_px = np.exp(measurements[:, 2])
    covariance[:, 0, 1, 1] = (settings.initial_speed_x * height_px) ** 2
    covariance[:, 1, 1, 1] = (settings.initial_speed_y * height_px) ** 2
    covariance[:, 2, 1, 1] = settings.initial_growth**2
    # The first box is blended with what is known of standing people before any box is seen.
    prior = settings.aspect_spread**2
    gain = prior / (prior + covariance[:, ASPECT, 0, 0])
    mean[:, ASPECT, 0] += (1 - gain) * (np.log(settings.aspect_mean) - measurements[:, ASPECT])
    covariance[:, ASPECT, 0, 0] *= gain
    return mean, covariance


def measurement_variance(measurements: FloatArray, settings: MotionSettings) -> FloatArray:
    """Variance (N, 4) of a detector's box about the person: px^2, px^2, and squared logarithms."""
    height_px = np.exp(measurements[:, 2])
    ones = np.ones_like(height_px)
    return np.stack(
        [
            (settings.noise_x * height_px) ** 2,
            (settings.noise_y * height_px) ** 2,
            settings.noise_height**2 * ones,
            settings.noise_aspect**2 * ones,
        ],
        axis=1,
    )


def predict(
    mean: FloatArray, covariance: FloatArray, elapsed_s: float, settings: MotionSettings
) -> tuple[FloatArray, FloatArray]:
    """Move all filters `elapsed_s` seconds on; arrays as returned by `initial_state`."""
    height_px = np.exp(mean[:, 2, 0])
    mean, covariance = mean.copy(), covariance.copy()
    noise = np.zeros((len(mean), ASPECT))
    noise[:, 0] = (settings.acceleration_x * height_px) ** 2
    noise[:, 1] = (settings.acceleration_y * height_px) ** 2
    noise[:, 2] = settings.acceleration_growth**2
    decay_s = np.array([settings.speed_memory_s, settings.speed_memory_s, settings.growth_memory_s])
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
    stay = np.exp(-elapsed_s / settings.aspect_memory_s)
    centre = np.log(settings.aspect_mean)
    mean[:, ASPECT, 0] = centre + stay * (mean[:, ASPECT, 0] - centre)
    spread = settings.aspect_spread**2
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
