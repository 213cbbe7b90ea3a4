"""Track of one person: motion, and evidence of existence and identity."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from heel.services.tracker.people import kalman
from heel.services.tracker.people.geometry import AXES, FloatArray
from heel.services.tracker.people.kalman import ASPECT
from heel.services.tracker.people.looks import Gallery
from heel.services.tracker.report import Report, faded

_LEAST_CONFIDENCE = 0.52
"""Reported confidence where motion gives no evidence of identity; fitted, see `Track.report`."""
_CONFIDENCE_RANGE = 0.40
"""Rise of that confidence where motion leaves no doubt; fitted with it."""
_FARTHEST_PX = 1e6
"""Coordinate beyond all pictures."""
_FASTEST = 1e9
"""Rate of any axis that no picture shows [1/s or px/s]."""
_MOST_LOG = 14.0
"""Size of the logarithms of height and aspect beyond all pictures: e^14 is 1.2e6 px."""
_LEAST_ODD = 0.05
"""Least likelihood ratio of a false alarm for one box, as a detector's errors repeat; chosen by
hand."""
_COPY_S = 1.5
"""Time between copies of a gallery [s]: what hides a person in passing does so for about a second;
chosen by hand."""
_SCORE_MEMORY_S = 1.0
"""Time constant of the mean score [s]; chosen by hand."""
_MOST_EXISTENCE = 0.99
"""Most probability of being a person, so that evidence against it still counts; chosen by hand."""


@dataclass(eq=False)
class Track:
    """Mutable record of one person; the tracker, its parts and its front end alone change it."""

    mean: FloatArray  # (4, 2), see kalman
    covariance: FloatArray  # (4, 2, 2)
    mean_score: float
    born_s: float
    seen_s: float
    alone_s: float  # last seen by a box of its own
    track_id: int = 0  # 0 until confirmed
    existence: float = 0.5
    hits: int = 1
    confirmed: bool = False
    confidence: float = 1.0  # that this is the person of the id
    confidence_before: float = 1.0  # the same before this frame's boxes
    predicted: tuple[FloatArray, FloatArray] | None = None  # mean and covariance, likewise
    runner_up: float = 0.0  # that this is the best other known person
    walked: bool = False  # has moved farther than the box of a thing
    gallery: Gallery = field(default_factory=Gallery)
    earlier: tuple[Gallery, Gallery] = field(default_factory=lambda: (Gallery(), Gallery()))
    earlier_s: float = -math.inf  # when the newer of these copies was made
    vouched: Gallery | None = None  # gallery from before a doubt that is not settled
    birthplace: FloatArray = field(default_factory=lambda: np.zeros(2))  # px
    anchor: FloatArray = field(default_factory=lambda: np.zeros(AXES))  # where last seen
    anchor_speed: float = 0.0  # heights per second at that moment
    anchor_spread_px: float = 0.0  # standard deviation by warps
    missed_frames: int = 0
    returning: bool = False  # measured again after time unseen, not yet compared with others
    compared: bool = False  # with the looks of people out of sight
    recalled: Gallery | None = None  # of the known person that this was found to be
    in_front: tuple[Track, ...] = ()  # occluders, nearest first
    proven: bool = True  # known to be a person, not a thing
    left: bool = False  # over the edge of the picture

    @classmethod
    def born(cls, mean: FloatArray, covariance: FloatArray, score: float, t_s: float) -> Track:
        """A new track, not confirmed."""
        track = cls(mean, covariance, score, t_s, t_s, t_s)
        track.see(t_s)
        track.birthplace = track.anchor[:2]
        return track

    def become(self, old: Track, probability: float) -> None:
        """Continue a known person's track, which this is with `probability` in [0, 1]."""
        self.track_id, self.recalled = old.track_id, old.gallery.copy()
        self.confidence = old.confidence * probability
        self.runner_up = min(old.runner_up, 1 - self.confidence)
        self.proven = self.proven or old.proven
        if old.gallery.looks > self.gallery.looks:
            self.gallery, self.vouched = old.gallery, old.vouched

    def part(self, fresh_id: int, gallery: Gallery, t_s: float) -> Track:
        """Go on as a newcomer; returned is the person that this was, as last known.

        Args:
            fresh_id: never given out before. gallery: of the person. t_s: now.
        """
        person = replace(
            self, mean=self.mean.copy(), covariance=self.covariance.copy(), gallery=gallery,
            vouched=None, in_front=(),
        )  # fmt: skip
        self.track_id, self.confidence, self.runner_up = fresh_id, 1.0, 0.0
        self.gallery, self.vouched = Gallery(), None
        self.earlier, self.earlier_s = (Gallery(), Gallery()), t_s
        self.born_s, self.hits, self.recalled = t_s, 1, None
        return person

    def remember(self, look: FloatArray, t_s: float) -> None:
        """Take in a (D,) descriptor of the person seen alone; copies of the gallery are kept."""
        if t_s - self.earlier_s >= _COPY_S:
            self.earlier, self.earlier_s = (self.earlier[1], self.gallery.copy()), t_s
        self.gallery.add(look)

    def gallery_before(self) -> Gallery:
        """The gallery of `_COPY_S` to twice that ago."""
        return self.earlier[0]

    def as_predicted(self) -> Track:
        """A copy in the state before this frame's boxes, which goes on without any."""
        mean, covariance = self.predicted or (self.mean, self.covariance)
        return replace(self, mean=mean.copy(), covariance=covariance.copy(), in_front=())

    def walked_by(self) -> float:
        """Distance from the place of birth, in heights."""
        x, y, log_height, _ = self.anchor.tolist()
        return math.hypot(x - self.birthplace[0], y - self.birthplace[1]) / math.exp(log_height)

    def see(self, t_s: float) -> None:
        """Note time and place of a measurement, after the filter was corrected."""
        self.seen_s, self.missed_frames = t_s, 0
        self.anchor_spread_px = 0.0
        self.anchor = self.mean[:, 0].copy()
        speed_x, speed_y = self.mean[:2, 1].tolist()
        self.anchor_speed = math.hypot(speed_x, speed_y) / math.exp(self.mean[2, 0])

    def jump(self, value: FloatArray, t_s: float) -> None:
        """Go to a place (4,) a little away from the prediction, and keep the velocity."""
        start, spread = kalman.initial_state(value[None])
        self.mean[:ASPECT, 0] = start[0, :ASPECT, 0]
        self.covariance[:ASPECT, 0, :] = self.covariance[:ASPECT, :, 0] = 0.0
        self.covariance[:ASPECT, 0, 0] = spread[0, :ASPECT, 0, 0]
        self.hits += 1
        self.see(t_s)

    def believe(self, score: float, shared: float, alone: bool, t_s: float) -> None:
        """Take a measurement of its own as evidence of being a person.

        Args:
            score: in [0, 1], read as the probability that what was measured is a person.
            shared: overlap in [0, 1] with a known person: the chance of a double of that one.
            alone: whether at least half of the person is in view.
            t_s: now.
        """
        elapsed_s = t_s - self.seen_s
        blend = max(1 - math.exp(-elapsed_s / _SCORE_MEMORY_S), 1 / (self.hits + 1))
        self.mean_score += blend * (score - self.mean_score)
        false_alarm = min((1 - score) / max(score, 1e-6), 1.0)
        odd = max(false_alarm, shared, _LEAST_ODD)
        self.existence = min(
            self.existence / (self.existence + (1 - self.existence) * odd), _MOST_EXISTENCE
        )
        self.hits += 1
        if alone:
            self.alone_s = t_s
        self.see(t_s)

    def doubt(self, rivals: float, best: float, memory: float) -> None:
        """Lower the confidence in the identity, after a box that may be another track's.

        Args:
            rivals: probability in [0, 1] that the box is any other track's. best: the likeliest's.
            memory: factor in [0, 1] for the time out of sight.
        """
        self.runner_up = min(self.runner_up + self.confidence * best, 1.0)
        self.confidence *= max(1 - rivals, 0.0) * memory

    def is_somewhere(self) -> bool:
        """Whether the state is within the bounds of pictures; False also where it is not finite.

        Warps add up for tracks out of sight, and those of a forged message can be large.
        """
        x, y, log_height, log_aspect = self.mean[:, 0].tolist()
        at_x, at_y = self.birthplace.tolist()
        near = max(abs(x), abs(y), abs(at_x), abs(at_y)) < _FARTHEST_PX
        shaped = max(abs(log_height), abs(log_aspect)) < _MOST_LOG
        return near and shaped and bool(np.abs(self.mean[:, 1]).max() < _FASTEST)

    def height_px(self) -> float:
        """Filtered height."""
        return math.exp(self.mean[2, 0])

    def box(self) -> FloatArray:
        """Filtered box, (4,) xyxy pixels."""
        # One person at a time: numbers are five times as fast as arrays here.
        x, y, log_height, log_aspect = self.mean[:, 0].tolist()
        half_height = math.exp(log_height) / 2
        half_width = half_height * math.exp(log_aspect)
        return np.array([x - half_width, y - half_height, x + half_width, y + half_height])

    def report(self, t_s: float, pictures: bool, shown: bool) -> Report:
        """The track as reported in this frame.

        Args:
            t_s: now. pictures: whether descriptors are known.
            shown: whether a user is shown the track, if it is confirmed.
        """
        confidence = faded(self.confidence, t_s - self.seen_s)
        if not pictures:
            # Fitted by least squares, and checked on sequences that were left out (see
            # docs/records/association.md). Marginals of neighbouring frames repeat one doubt,
            # hence the root; appearance, where it is known, settles it.
            confidence = _LEAST_CONFIDENCE + _CONFIDENCE_RANGE * math.sqrt(confidence)
        left, top, right, bottom = self.box().tolist()
        speed_x, speed_y = self.mean[:2, 1].tolist()
        return Report(
            id=self.track_id,
            box_xyxy=(left, top, right, bottom),
            velocity_pxps=(speed_x, speed_y),
            confirmed=self.confirmed,
            alone=self.alone_s == t_s,
            missed_frames=self.missed_frames,
            in_front=tuple(other.track_id for other in self.in_front if other.track_id),
            identity_confidence=confidence,
            runner_up_confidence=self.runner_up,
            shown=shown,
            proven=self.proven,
        )
