"""Birth, confirmation and death of a tracked person, and how sure the identity is."""

from __future__ import annotations

import math

from heel.schemas.base import BoxXyxy
from heel.services.geometry import boxes
from heel.services.tracker.paper.features import Features
from heel.services.tracker.paper.kalman import BoxFilter
from heel.services.tracker.paper.settings import BlobSettings


class Person:
    """What is known of one person."""

    def __init__(self, person_id: int, box: BoxXyxy, settings: BlobSettings) -> None:
        """Born where an unexplained blob was seen."""
        self.id = person_id
        self.filter = BoxFilter(box, settings)
        self.confirmed = False
        self.hits = 1
        self.missed_frames = 0
        self.missed_s = 0.0
        self.reference: Features | None = None
        self.identity_confidence = 1.0
        self.runner_up_confidence = 0.0
        self._settings = settings
        self._settled_confidence = 1.0

    @property
    def box(self) -> BoxXyxy:
        """Where the person is, xyxy."""
        return self.filter.box

    def is_dead(self, frame_box: BoxXyxy) -> bool:
        """Never confirmed and missed, missed for too long, or outside the frame."""
        outside = boxes.cover(self.box, frame_box) < 0.1
        if not self.confirmed:
            return self.missed_frames > 1 or (self.missed_frames > 0 and outside)
        return self.missed_s > self._settings.forget_s or (self.missed_frames > 0 and outside)

    @property
    def is_shown(self) -> bool:
        """Whether a user would be shown this person's box."""
        return self.confirmed and self.missed_s <= self._settings.show_missed_s

    def seen_alone(self, dt_s: float) -> None:
        """Seen in this frame with a blob of its own."""
        self.hits += 1
        self.missed_frames, self.missed_s = 0, 0.0
        regained = 1.0 - math.exp(-dt_s / self._settings.trust_s)
        self.identity_confidence += regained * (self._settled_confidence - self.identity_confidence)
        self.confirmed |= self.hits >= self._settings.confirm_hits

    def seen_in_group(self, dt_s: float) -> None:
        """Seen in this frame as part of a blob of several people."""
        self.missed_frames, self.missed_s = 0, 0.0
        self._doubt(dt_s)

    def missed(self, dt_s: float) -> None:
        """Not seen in this frame."""
        self.missed_frames += 1
        self.missed_s += dt_s
        self.filter.coast(dt_s)
        self._doubt(dt_s)

    def identified(self, confidence: float) -> None:
        """Identified at a split; the doubt of earlier splits stays."""
        self._settled_confidence *= confidence
        self.identity_confidence = self._settled_confidence
        self.runner_up_confidence = 1.0 - confidence

    def remember(self, features: Features, dt_s: float) -> None:
        """Blend the features seen now into the reference features."""
        if self.reference is None:
            self.reference = features
            return
        share = 1.0 - math.exp(-dt_s / self._settings.reference_memory_s)
        self.reference = {
            family: (1 - share) * self.reference[family] + share * vector
            for family, vector in features.items()
        }

    def _doubt(self, dt_s: float) -> None:
        self.identity_confidence *= math.exp(-dt_s / self._settings.doubt_s)
