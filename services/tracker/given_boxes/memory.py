"""Long memory: is a newcomer somebody who was lost?

A lost person is not offered to single boxes, which jump, but to newcomers that have been seen
long enough to have a speed. Accounts of the gap compete: the person walked on as the filter
predicts, stayed where last seen, or, where looks can tell, is back anywhere. Against all stands the
account that the newcomer is new.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from heel.services.tracker.given_boxes.association import assign, marginals
from heel.services.tracker.given_boxes.geometry import FloatArray
from heel.services.tracker.given_boxes.settings import MemorySettings, MotionSettings
from heel.services.tracker.given_boxes.track import Track


@dataclass(frozen=True)
class Circumstances:
    """What a return is judged by, beside the two people.

    Attributes:
        t_s: now.
        places: whether places in the picture are places in the world.
        area_px2: of the picture if looks tell people apart, so that they may be back anywhere.
    """

    t_s: float
    places: bool
    area_px2: float | None


def return_log_odds(
    newcomer: Track,
    lost: Track,
    around: Circumstances,
    settings: MemorySettings,
    motion: MotionSettings,
) -> float:
    """Log odds that `newcomer` is `lost` come back rather than somebody new."""
    if newcomer.born_s < lost.seen_s:
        return -math.inf
    rate = settings.return_rate * math.exp(-(around.t_s - lost.seen_s) / settings.return_time_s)
    height = math.exp(lost.anchor[2])
    by_place = -math.inf
    if around.places and not lost.left:
        stay = math.exp(-0.5 * (lost.anchor_speed / settings.settle_speed) ** 2)
        both = np.logaddexp(
            math.log(max(stay, 1e-12)) + _log_stayed(newcomer, lost, height, settings, motion),
            math.log(max(1 - stay, 1e-12)) + _log_walked(newcomer, lost, height),
        )
        by_place = float(both) - _log_new(newcomer, height, settings, motion)
    by_place += math.log(rate) - math.log1p(-rate)
    if around.area_px2 is None:
        return by_place
    share = settings.elsewhere if by_place > -math.inf else 1.0
    newcomers = settings.newcomer_density * max(around.area_px2 / height**2, 1.0)
    anywhere = math.log(share * settings.return_rate / newcomers)
    return float(np.logaddexp(by_place + math.log1p(-min(share, 1 - 1e-9)), anywhere))


def claims(
    newcomers: list[Track],
    lost: list[Track],
    looks: FloatArray | float,
    around: Circumstances,
    settings: MemorySettings,
    motion: MotionSettings,
) -> list[tuple[Track, Track, float]]:
    """Newcomers who are lost people: (newcomer, lost, probability), only where it is sure enough.

    Args:
        newcomers: tracks about to be confirmed, or confirmed lately. lost: people out of sight.
        looks: (len(lost), len(newcomers)) log odds of looking the same, or 0.
        around: time, camera and picture.
        settings: priors and the least probability.
        motion: how newcomers move.
    """
    if not newcomers or not lost:
        return []
    odds = np.array(
        [[return_log_odds(new, old, around, settings, motion) for new in newcomers] for old in lost]
    )
    odds = np.maximum(odds + looks, -1e6)
    sure = marginals(odds)
    return [
        (newcomers[j], lost[i], float(sure[i, j]))
        for i, j in assign(odds)
        if sure[i, j] >= (settings.later_trust if newcomers[j].confirmed else settings.trust)
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
        carried = (lost.anchor_spread_px / height) ** 2
        variance = spread**2 + carried + newcomer.covariance[axis, 0, 0] / height**2
        total += _gauss(residual, variance)
        speed = float(newcomer.mean[axis, 1]) / height
        variance = settings.settle_speed**2 + newcomer.covariance[axis, 1, 1] / height**2
        total += _gauss(speed, variance)
    total += _gauss(float(newcomer.mean[2, 0] - lost.anchor[2]), 2 * motion.noise_height**2)
    aspect_variance = newcomer.covariance[3, 0, 0] + lost.covariance[3, 0, 0]
    return total + _gauss(float(newcomer.mean[3, 0] - lost.anchor[3]), aspect_variance)
