"""What the tracker keeps about one person."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from heel.services.geometry.picture_motion import moved_point
from heel.services.tracker.evidence.appearance import Look
from heel.services.tracker.evidence.arrays import Box, Floats, Foot, box_at
from heel.services.tracker.evidence.kalman import FootFilter
from heel.services.tracker.evidence.scale import SceneScale

_HEIGHT_MEMORY_S = 1.5
"""Seconds: time constant with which a height comes back to the scene's line; chosen by hand."""
_HEIGHT_WALK = 0.1
"""Random walk of ln(height) per square root of a second: people bend, and the line is not exact;
chosen by hand."""
_HEIGHT_VARIANCE = 0.01
"""Variance of ln(height) at birth, a deviation of 10 %, and the most it grows to. Chosen by
hand."""
_LIMIT_DEVIATIONS = 5.0
"""Deviations around the scene's line beyond which no height may be: wide, for it only stops a
height that runs away; chosen by hand."""
_FRICTION_PER_S = 0.36
"""1/s: rate at which the velocity decays while the person is missed, as people stop and turn
unseen; chosen by hand."""
_GAINS = 60
"""Gains kept, of the last frames in view, for the median before a newcomer: two to four seconds at
15 to 30 frames a second; chosen by hand."""
_FREE_VIEW = 0.8
"""Share of the silhouette in view above which a person counts as covered by no other one; chosen by
hand."""
CERTAIN = 0.99
"""Confidence in a person that was never in contact with others: short of 1, for no track is beyond
doubt; chosen by hand."""


@dataclass(eq=False)
class Person:
    """One hypothesis: a person stands at the filter's foot point, `height` working pixels high.

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
        gains: the last ones while no other person covered this one.
        is_newcomer: may be a person that was lost.
        is_replaced: another track turned out to be this person.
        identity_confidence: after the contacts decided so far.
        runner_up_confidence: the same for the best other identity.
        rivals: ids of people met since the identity was last decided, and the probability that
            the two were exchanged.
        looks: appearance descriptors in the open since then, oldest first.
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
        """Seen clearly, covered by no other person and inside the image."""
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
        """Warp all places by the camera's motion: (2, 3), old to new working pixels."""
        self.filter.carry(affine)
        zoom = math.hypot(affine[0, 0], affine[1, 0])
        self.height *= zoom
        self.birth_foot = moved_point(affine, self.birth_foot)
        self.seen_foot = moved_point(affine, self.seen_foot)

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
        """Become a newcomer, which may be re-identified as a lost person."""
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
