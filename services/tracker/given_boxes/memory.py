"""Long memory: is a newcomer somebody who was lost?

A lost person is not offered to single boxes, which jump, but to newcomers that have been seen
long enough to have a speed. Two accounts of the gap compete: the person walked on as the filter
predicts, or stayed where last seen. Against both stands the account that the newcomer is new.
"""

from __future__ import annotations

import math

import numpy as np

from services.tracker.given_boxes.association import assign, marginals
from services.tracker.given_boxes.geometry import FloatArray
from services.tracker.given_boxes.settings import MemorySettings, MotionSettings
from services.tracker.given_boxes.track import Track


def return_log_odds(
    newcomer: Track, lost: Track, t_s: float, settings: MemorySettings, motion: MotionSettings
) -> float:
    """Log odds that `newcomer` is `lost` come back rather than somebody new."""
    if newcomer.born_s < lost.seen_s:
        return -math.inf
    gap_s = t_s - lost.seen_s
    rate = settings.return_rate * math.exp(-gap_s / settings.return_time_s)
    height = math.exp(lost.anchor[2])
    stay = math.exp(-0.5 * (lost.anchor_speed / settings.settle_speed) ** 2)
    stayed = _log_stayed(newcomer, lost, height, settings, motion)
    walked = _log_walked(newcomer, lost, height)
    both = np.logaddexp(
        math.log(max(stay, 1e-12)) + stayed, math.log(max(1 - stay, 1e-12)) + walked
    )
    return float(
        both - _log_new(newcomer, height, settings, motion) + math.log(rate) - math.log1p(-rate)
    )


def claims(
    newcomers: list[Track],
    lost: list[Track],
    looks: FloatArray | float,
    t_s: float,
    settings: MemorySettings,
    motion: MotionSettings,
) -> list[tuple[Track, Track, float]]:
    """Newcomers who are lost people: (newcomer, lost, probability), only where it is sure enough.

    Args:
        newcomers: tracks about to be confirmed. lost: people out of sight.
        looks: (len(lost), len(newcomers)) log odds of looking the same, or 0.
        t_s: now.
        settings: priors and the least probability.
        motion: how newcomers move.
    """
    if not newcomers or not lost:
        return []
    odds = np.array(
        [[return_log_odds(new, old, t_s, settings, motion) for new in newcomers] for old in lost]
    )
    odds = np.maximum(odds + looks, -1e6)
    sure = marginals(odds)
    return [
        (newcomers[j], lost[i], float(sure[i, j]))
        for i, j in assign(odds)
        if sure[i, j] >= settings.trust
    ]


def _gauss(residual: float, variance: float) -> float:
    return -0.5 * (residual**2 / variance + math.log(2 * math.pi * variance))


def _log_new(
    newcomer: Track, height: float, settings: MemorySettings, motion: MotionSettings
) -> float:
    speed = newcomer.mean[:2, 1] / height
    log_density = math.log(settings.newcomer_density)
    for axis, spread in enumerate((motion.initial_speed_x, motion.initial_speed_y)):
        variance = newcomer.covariance[axis, 1, 1] / height**2 + spread**2
        log_density += _gauss(float(speed[axis]), variance)
    log_density += _gauss(float(newcomer.mean[2, 0] - math.log(height)) * 0.5, 0.5**2)
    aspect = float(newcomer.mean[3, 0]) - math.log(motion.aspect_mean)
    return log_density + _gauss(aspect, motion.aspect_spread**2 + newcomer.covariance[3, 0, 0])


def _log_walked(newcomer: Track, lost: Track, height: float) -> float:
    total = 0.0
    for axis in (0, 1):
        residual = (newcomer.mean[axis] - lost.mean[axis]) / height
        covariance = (newcomer.covariance[axis] + lost.covariance[axis]) / height**2
        determinant = covariance[0, 0] * covariance[1, 1] - covariance[0, 1] ** 2
        squared = (
            covariance[1, 1] * residual[0] ** 2
            - 2 * covariance[0, 1] * residual[0] * residual[1]
            + covariance[0, 0] * residual[1] ** 2
        ) / determinant
        total += -0.5 * squared - math.log(2 * math.pi) - 0.5 * math.log(determinant)
    for axis in (2, 3):
        variance = newcomer.covariance[axis, 0, 0] + lost.covariance[axis, 0, 0]
        total += _gauss(float(newcomer.mean[axis, 0] - lost.mean[axis, 0]), variance)
    return total


def _log_stayed(
    newcomer: Track, lost: Track, height: float, settings: MemorySettings, motion: MotionSettings
) -> float:
    total = 0.0
    for axis, spread in ((0, settings.settle_spread), (1, settings.settle_spread / 2)):
        residual = float(newcomer.mean[axis, 0] - lost.anchor[axis]) / height
        total += _gauss(residual, spread**2 + newcomer.covariance[axis, 0, 0] / height**2)
        speed = float(newcomer.mean[axis, 1]) / height
        variance = settings.settle_speed**2 + newcomer.covariance[axis, 1, 1] / height**2
        total += _gauss(speed, variance)
    total += _gauss(float(newcomer.mean[2, 0] - lost.anchor[2]), 2 * motion.noise_height**2)
    aspect_variance = newcomer.covariance[3, 0, 0] + lost.covariance[3, 0, 0]
    return total + _gauss(float(newcomer.mean[3, 0] - lost.anchor[3]), aspect_variance)
