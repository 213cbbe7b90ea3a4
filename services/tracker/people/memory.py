"""Re-identification: log odds that a new track is a lost person.

A lost track is not associated with single boxes, which jump, but with new tracks that have been
seen long enough to have a speed. Hypotheses for the time between compete: the person walked on as
the filter predicts, stayed where last seen, or, where appearance can decide, is back anywhere. The
alternative to all of them is that the track is of a new person.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from heel.services.tracker.people.association import assign, marginals
from heel.services.tracker.people.geometry import FloatArray
from heel.services.tracker.people.kalman import (
    ASPECT_MEAN,
    ASPECT_SPREAD,
    INITIAL_SPEED_X,
    INITIAL_SPEED_Y,
    NOISE_HEIGHT,
)
from heel.services.tracker.people.track import Track
from heel.services.tracker.trace import Event, probable

_RETURN_RATE = 0.5
"""Prior probability that a person just lost comes back; chosen by hand."""
_RETURN_TIME_S = 20.0
"""Time in which the prior of a return falls to 1/e [s]; chosen by hand."""
_NEWCOMER_DENSITY = 0.05
"""Expected new people per square height of image; chosen by hand."""
_SETTLE_SPEED = 0.15
"""Standard deviation of the measured speed of a person that stands [heights/s], whose box jitters;
chosen by hand."""
_SETTLE_SPREAD = 0.2
"""Standard deviation of the place of a person that has stayed [heights]; chosen by hand."""
_ELSEWHERE = 0.3
"""Share of returns, recognised by appearance, that are at any place; chosen by hand."""
_FASTEST = 3.0
"""Speed beyond which nobody moves [heights/s]: a sprint, 5 m/s; chosen by hand."""
_REACH_SLACK = 1.0
"""What a box may be off beside it, at the side of the picture above all [heights]; chosen by
hand."""
_LATER_TRUST = 0.95
"""Least probability of a return for a track that has an id already; chosen by hand."""


@dataclass(frozen=True)
class Circumstances:
    """Conditions of a return, beside the two tracks.

    Attributes:
        t_s: now.
        places: whether places in the picture are places in the world.
        area_px2: of the picture if appearance is known, so that a return may be anywhere.
    """

    t_s: float
    places: bool
    area_px2: float | None


class Claim(NamedTuple):
    """The known person that a new track most probably is.

    Attributes:
        newcomer: the new track.
        known: the track out of sight.
        probability: that the two are the same person.
        runner_up: the next best track out of sight; None where there is no other.
        runner_up_probability: of that one.
        new_probability: that the track is of none of them.
        holds: whether the old id is given back.
    """

    newcomer: Track
    known: Track
    probability: float
    runner_up: Track | None
    runner_up_probability: float
    new_probability: float
    holds: bool

    def event(self) -> Event:
        """The re-identification, or whom the newcomer was compared with and is not."""
        known, new = self.known.track_id, self.newcomer.track_id
        if not self.holds:
            return Event(
                "new", id=new, probability=probable(self.new_probability), runner_up=known,
                runner_up_probability=probable(self.probability),
            )  # fmt: skip
        rival, rival_probability = 0, self.new_probability
        if self.runner_up is not None and self.runner_up_probability > rival_probability:
            rival, rival_probability = self.runner_up.track_id, self.runner_up_probability
        return Event(
            "re-identified", id=known, other=new, probability=probable(self.probability),
            runner_up=rival, runner_up_probability=probable(rival_probability),
        )  # fmt: skip


def return_log_odds(
    newcomer: Track,
    lost: Track,
    around: Circumstances,
) -> float:
    """Log odds that `newcomer` is the return of `lost` rather than a new person."""
    if newcomer.born_s < lost.seen_s:
        return -math.inf
    rate = _RETURN_RATE * math.exp(-(around.t_s - lost.seen_s) / _RETURN_TIME_S)
    height = math.exp(lost.anchor[2])
    by_place = -math.inf
    if around.places and not lost.left:
        stay = math.exp(-0.5 * (lost.anchor_speed / _SETTLE_SPEED) ** 2)
        both = np.logaddexp(
            math.log(max(stay, 1e-12)) + _log_stayed(newcomer, lost, height),
            math.log(max(1 - stay, 1e-12)) + _log_walked(newcomer, lost, height),
        )
        by_place = float(both) - _log_new(newcomer, height)
    by_place += math.log(rate) - math.log1p(-rate)
    if around.area_px2 is None:
        return by_place
    if around.places and _out_of_reach(newcomer, lost):
        return by_place
    share = _ELSEWHERE if by_place > -math.inf else 1.0
    newcomers = _NEWCOMER_DENSITY * max(around.area_px2 / height**2, 1.0)
    anywhere = math.log(share * _RETURN_RATE / newcomers)
    return float(np.logaddexp(by_place + math.log1p(-min(share, 1 - 1e-9)), anywhere))


def _out_of_reach(newcomer: Track, lost: Track) -> bool:
    """Whether nobody gets from where one was last seen to where the other was seen first in time.

    Who leaves the picture on the right is not who enters it on the left a moment later, however
    alike they are.
    """
    height = math.exp(max(lost.anchor[2], newcomer.mean[2, 0]))
    x, y = (newcomer.birthplace - lost.anchor[:2]).tolist()
    reach = _FASTEST * (newcomer.born_s - lost.seen_s) + _REACH_SLACK
    return math.hypot(x, y) > reach * height


def claims(
    newcomers: list[Track],
    lost: list[Track],
    looks: FloatArray | float,
    around: Circumstances,
    trust: float,
) -> list[Claim]:
    """Which lost person each newcomer most probably is, and whether that is probable enough.

    Args:
        newcomers: tracks about to be confirmed, or confirmed lately. lost: tracks out of sight.
        looks: (len(lost), len(newcomers)) log odds of appearance, or 0.
        around: time, camera and picture.
        trust: least probability of a return that gives the old id back.
    """
    if not newcomers or not lost:
        return []
    odds = np.array([[return_log_odds(new, old, around) for new in newcomers] for old in lost])
    odds = np.maximum(odds + looks, -1e6)
    sure = marginals(odds)
    assigned = {j: i for i, j in assign(odds)}
    return [_claim(newcomers, lost, sure, j, assigned.get(j), trust) for j in range(len(newcomers))]


def _claim(
    newcomers: list[Track], lost: list[Track], sure: FloatArray, j: int, assigned: int | None,
    trust: float,
) -> Claim:  # fmt: skip
    """The claim of newcomer `j`; one that is assigned to no lost person does not hold."""
    column = sure[:, j]
    best = int(np.argmax(column)) if assigned is None else assigned
    least = _LATER_TRUST if newcomers[j].confirmed else trust
    others = column.copy()
    others[best] = -1.0
    second = int(np.argmax(others))
    return Claim(
        newcomers[j], lost[best], float(column[best]),
        lost[second] if second != best else None, max(float(others[second]), 0.0),
        max(1.0 - float(column.sum()), 0.0), assigned is not None and bool(column[best] >= least),
    )  # fmt: skip


def _gauss(residual: float, variance: float) -> float:
    return -0.5 * (residual**2 / variance + math.log(2 * math.pi * variance))


def _log_new(newcomer: Track, height: float) -> float:
    speed = newcomer.mean[:2, 1] / height
    log_density = math.log(_NEWCOMER_DENSITY)
    for axis, spread in enumerate((INITIAL_SPEED_X, INITIAL_SPEED_Y)):
        variance = newcomer.covariance[axis, 1, 1] / height**2 + spread**2
        log_density += _gauss(float(speed[axis]), variance)
    log_density += _gauss(float(newcomer.mean[2, 0] - math.log(height)) * 0.5, 0.5**2)
    aspect = float(newcomer.mean[3, 0]) - math.log(ASPECT_MEAN)
    return log_density + _gauss(aspect, ASPECT_SPREAD**2 + newcomer.covariance[3, 0, 0])


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


def _log_stayed(newcomer: Track, lost: Track, height: float) -> float:
    total = 0.0
    for axis, spread in ((0, _SETTLE_SPREAD), (1, _SETTLE_SPREAD / 2)):
        residual = float(newcomer.mean[axis, 0] - lost.anchor[axis]) / height
        carried = (lost.anchor_spread_px / height) ** 2
        variance = spread**2 + carried + newcomer.covariance[axis, 0, 0] / height**2
        total += _gauss(residual, variance)
        speed = float(newcomer.mean[axis, 1]) / height
        variance = _SETTLE_SPEED**2 + newcomer.covariance[axis, 1, 1] / height**2
        total += _gauss(speed, variance)
    total += _gauss(float(newcomer.mean[2, 0] - lost.anchor[2]), 2 * NOISE_HEIGHT**2)
    aspect_variance = newcomer.covariance[3, 0, 0] + lost.covariance[3, 0, 0]
    return total + _gauss(float(newcomer.mean[3, 0] - lost.anchor[3]), aspect_variance)
