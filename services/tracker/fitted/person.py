"""What the tracker keeps about one person."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from heel.services.tracker.fitted.appearance import Look
from heel.services.tracker.fitted.arrays import Box, Floats, Foot, box_at, carried
from heel.services.tracker.fitted.kalman import FootFilter
from heel.services.tracker.fitted.scale import SceneScale

_HEIGHT_MEMORY_S = 1.5
"""A height that differs from the scene's line comes back to it with this time constant."""
_HEIGHT_WALK, _HEIGHT_VARIANCE = 0.1, 0.01
"""Of ln(height): random walk per square root of a second, and variance at birth."""
_LIMIT_DEVIATIONS = 5.0
_FRICTION_PER_S = 0.36
"""Velocity decays at this rate while nobody is seen."""
_GAINS, _FREE_VIEW = 60, 0.8
CERTAIN = 0.99
"""Confidence in somebody who was never in contact with others."""


@dataclass(eq=False)
class Person:
    """One hypothesis: somebody stands at the filter's foot point, `height` working pixels high.

    Attributes:
        gain: of the fit in this frame, see `canvas.Fit`.
        visibility: mean of the evidence under the silhouette.
        inside: share of the silhouette inside the image.
        in_view: share of the silhouette that no nearer person covers.
        fitted_foot: where the template was placed in this frame.
        duplicate_s: for how long others have explained all of this person's evidence.
        still_s: for how long nothing has moved where the person is seen.
        seen_foot: where the person was seen last.
        born_early: when the background was hardly known.
        born_at_border: of the image, where people come and go.
        gains: the last ones while nobody covered the person.
        is_newcomer: may be somebody who was lost.
        is_replaced: somebody else turned out to be this person.
        identity_confidence: after the contacts decided so far.
        runner_up_confidence: the same for the best other identity.
        rivals: ids of those met since the identity was last decided, and the probability that
            the two were exchanged.
        looks: in the open since then, oldest first.
    """

    id: int
    filter: FootFilter
    height: float
    birth_foot: Foot
    gain: float
    hits: int = 1
    moving_hits: int = 0
    missed_frames: int = 0
    missed_s: float = 0.0
    confirmed: bool = False
    best_gain: float = 0.0
    visibility: float = 0.0
    inside: float = 1.0
    in_view: float = 1.0
    duplicate_s: float = 0.0
    still_s: float = 0.0
    born_early: bool = False
    fitted_foot: Foot = (0.0, 0.0)
    height_variance: float = _HEIGHT_VARIANCE
    seen_foot: Foot = (0.0, 0.0)
    born_at_border: bool = False
    gains: deque[float] = field(default_factory=lambda: deque(maxlen=_GAINS))
    is_newcomer: bool = True
    is_replaced: bool = False
    identity_confidence: float = CERTAIN
    runner_up_confidence: float = 0.0
    rivals: dict[int, float] = field(default_factory=dict)
    looks: list[Look] = field(default_factory=list)

    @property
    def foot(self) -> Foot:
        """Foot point, working pixels."""
        return self.filter.foot

    @property
    def is_in_the_open(self) -> bool:
        """Seen clearly, by oneself and inside the image."""
        clear = self.gain > 0.45 and self.visibility > 0.5
        return self.missed_frames == 0 and clear and self.in_view > _FREE_VIEW and self.inside > 0.9

    def predict(self, dt_s: float, scale: SceneScale) -> None:
        """Move on by `dt_s`; the height follows the scene's line where that is known."""
        damping = 1.0 if self.missed_frames == 0 else math.exp(-_FRICTION_PER_S * dt_s)
        before = self.foot[1]
        self.filter.predict(dt_s, self.height, damping)
        variance = self.height_variance + _HEIGHT_WALK**2 * dt_s
        self.height_variance = min(variance, _HEIGHT_VARIANCE)
        if scale.known:
            row = self.foot[1]
            self.height *= scale.height(row) / scale.height(before)
            away = math.log(self.height / scale.height(row))
            limit = _LIMIT_DEVIATIONS * scale.spread()
            pull = (1.0 - math.exp(-dt_s / _HEIGHT_MEMORY_S)) * away
            beyond = away - float(np.clip(away, -limit, limit))
            self.height *= math.exp(-pull - beyond)

    def carry(self, affine: Floats) -> None:
        """Move with the picture when the camera moves: (2, 3), old to new working pixels."""
        self.filter.carry(affine)
        zoom = math.hypot(affine[0, 0], affine[1, 0])
        self.height *= zoom
        self.birth_foot = carried(self.birth_foot, affine)
        self.seen_foot = carried(self.seen_foot, affine)

    def miss(self, dt_s: float) -> None:
        """Not seen in this frame."""
        self.missed_frames += 1
        self.missed_s += dt_s

    def see(self, foot: Foot, deviation_px: float) -> None:
        """Seen in this frame at `foot`."""
        self.hits += 1
        self.best_gain = max(self.best_gain, self.gain)
        self.missed_frames, self.missed_s = 0, 0.0
        self.filter.correct(foot, deviation_px)
        self.seen_foot = self.foot
        if self.in_view > _FREE_VIEW:
            self.gains.append(self.gain)

    def reacquire(self, foot: Foot, height: float, gain: float) -> None:
        """Seen again a little away from the prediction: keep identity and velocity, jump there."""
        self.filter.move_to(foot, height)
        self.height = height
        self.gain = gain
        self.missed_frames, self.missed_s = 0, 0.0
        self.seen_foot = foot
        self.hits += 1

    def rename(self, key: int) -> None:
        """Be somebody new, who may turn out to be somebody lost."""
        self.id = key
        self.is_newcomer = True
        self.identity_confidence, self.runner_up_confidence = CERTAIN, 0.0

    def correct_height(self, height: float, deviation: float) -> None:
        """Take in a measured height; `deviation` is that of its logarithm."""
        gain = self.height_variance / (self.height_variance + deviation * deviation)
        self.height_variance *= 1.0 - gain
        self.height *= math.exp(gain * math.log(height / self.height))

    def box(self, ratio: float) -> Box:
        """xyxy, working pixels; `ratio` is width by height."""
        return box_at(self.foot, self.height, ratio)

    def moved(self) -> float:
        """Distance from where the person was born, in heights."""
        return math.dist(self.foot, self.birth_foot) / self.height

    def distance(self, foot: Foot) -> float:
        """In heights of the person."""
        return math.dist(self.foot, foot) / self.height
