"""One person as the tracker knows them: motion, and evidence of being real and the same."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from services.tracker.given_boxes.geometry import AXES, FloatArray
from services.tracker.given_boxes.settings import LifeSettings

_EPSILON_S = 1e-6
_LEAST_CONFIDENCE, _CONFIDENCE_RANGE = 0.51, 0.39
_LEAST_ODD = 0.05  # no single box is better evidence than 20 to 1: detectors err twice in a row


class TrackState(Enum):
    """Where a track is in its life."""

    NEW = "new"
    TRACKED = "tracked"
    OCCLUDED = "occluded"
    LOST = "lost"


@dataclass(frozen=True)
class TrackOutput:
    """What a user is told about one person in one frame.

    Attributes:
        track_id: unique for the life of the tracker, never reused, from 1.
        state: see `TrackState`.
        box: (4,) xyxy pixels, filtered.
        identity_confidence: probability in [0, 1] that this is still the person who got the id.
        shown: whether a user should be shown the box.
    """

    track_id: int
    state: TrackState
    box: FloatArray
    identity_confidence: float
    shown: bool


@dataclass
class Track:
    """Mutable record of one person; `BoxTracker` alone changes it."""

    mean: FloatArray  # (4, 2), see kalman
    covariance: FloatArray  # (4, 2, 2)
    mean_score: float
    born_s: float
    seen_s: float
    alone_s: float  # last seen by a box of one's own
    track_id: int = 0  # 0 until confirmed
    existence: float = 0.5
    hits: int = 1
    confirmed: bool = False
    confidence: float = 1.0
    walked: bool = False  # has moved as only people do
    look: FloatArray | None = None  # (D,) mean look of unit length, see appearance
    looks: int = 0
    birthplace: FloatArray = field(default_factory=lambda: np.zeros(2))  # px
    anchor: FloatArray = field(default_factory=lambda: np.zeros(AXES))  # where last seen
    anchor_speed: float = 0.0  # heights per second at that moment

    @classmethod
    def born(cls, mean: FloatArray, covariance: FloatArray, score: float, t_s: float) -> Track:
        """A newcomer, not yet confirmed."""
        track = cls(mean, covariance, score, t_s, t_s, t_s)
        track.see(t_s)
        track.birthplace = track.anchor[:2]
        return track

    def walked_by(self) -> float:
        """Distance from where the track was born, in heights."""
        x, y, log_height, _ = self.anchor.tolist()
        return math.hypot(x - self.birthplace[0], y - self.birthplace[1]) / math.exp(log_height)

    def see(self, t_s: float) -> None:
        """Note when and where the person was seen, after the filter was corrected."""
        self.seen_s = t_s
        self.anchor = self.mean[:, 0].copy()
        speed_x, speed_y = self.mean[:2, 1].tolist()
        self.anchor_speed = math.hypot(speed_x, speed_y) / math.exp(self.mean[2, 0])

    def believe(self, score: float, shared: float, t_s: float, life: LifeSettings) -> None:
        """Take a box of one's own as evidence of being a person.

        Args:
            score: the detector's, in [0, 1], read as the probability that the box is a person.
            shared: overlap in [0, 1] with a person known already: the chance of a second box of it.
            t_s: now.
            life: memory of the mean score.
        """
        elapsed_s = t_s - self.seen_s
        blend = max(1 - math.exp(-elapsed_s / life.score_memory_s), 1 / (self.hits + 1))
        self.mean_score += blend * (score - self.mean_score)
        false_alarm = min((1 - score) / max(score, 1e-6), 1.0)
        odd = max(false_alarm, shared, _LEAST_ODD)
        self.existence = min(self.existence / (self.existence + (1 - self.existence) * odd), 0.99)
        self.hits += 1
        self.alone_s = t_s
        self.see(t_s)

    def ready(self, life: LifeSettings) -> bool:
        """Whether a newcomer is sure enough to be shown."""
        return bool(
            not self.confirmed
            and self.hits >= life.confirm_hits
            and self.existence >= life.confirm_existence
            and self.mean_score >= (life.walker_score if self.walked else life.shown_score)
        )

    def box(self) -> FloatArray:
        """Filtered box, (4,) xyxy pixels."""
        # One person at a time: numbers are five times as fast as arrays here.
        x, y, log_height, log_aspect = self.mean[:, 0].tolist()
        half_height = math.exp(log_height) / 2
        half_width = half_height * math.exp(log_aspect)
        return np.array([x - half_width, y - half_height, x + half_width, y + half_height])

    def output(self, t_s: float, life: LifeSettings) -> TrackOutput:
        """What a user is told at `t_s`."""
        unseen_s = t_s - self.seen_s
        state = TrackState.TRACKED if unseen_s == 0 else TrackState.LOST
        if unseen_s == 0 and self.alone_s < t_s:
            state = TrackState.OCCLUDED
        if not self.confirmed:
            state = TrackState.NEW
        least = life.walker_score if self.walked else life.hidden_score
        shown = self.confirmed and unseen_s <= life.coast_s + _EPSILON_S
        # Fitted by least squares on 8 sequences; left-out sequences keep to it (see
        # docs/association.md). Marginals of neighbouring frames repeat one doubt, hence the root.
        confidence = _LEAST_CONFIDENCE + _CONFIDENCE_RANGE * math.sqrt(self.confidence)
        shown = shown and self.mean_score >= least
        return TrackOutput(self.track_id, state, self.box(), confidence, shown)
