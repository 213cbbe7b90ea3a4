"""Identities of two people after a contact: the paper's decision at the split, by appearance.

While two people can be confused, their galleries stay as they were before. Once both, or one of
them, are seen alone again, each appearance descriptor is compared with both galleries. If the
descriptors decide that the two tracks were exchanged, the ids are exchanged back; if they cannot
decide, as with twins, the doubt that motion left stays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heel.services.tracker.people.geometry import FloatArray
from heel.services.tracker.people.looks import Gallery, LookModel
from heel.services.tracker.people.track import Track
from heel.services.tracker.trace import Event, Trace, bounded, probable

_LEAST_LOOKS = 2
"""Frames with a descriptor before a contact is decided; chosen by hand."""
_INDEPENDENT = 4.0
"""Descriptors up to which evidence adds up, as those of neighbouring frames are not independent;
chosen by hand."""
_MOST_OF_ONE = 4.0
"""Most log odds of one descriptor: one in some twenty holds pixels of another person or a lamp
post; chosen by hand."""
_MOST_PRIOR = 4.0
"""Most log odds that motion alone can give; chosen by hand."""
_MOST_OPEN = 64
"""Most undecided contacts: of more the oldest are left undecided. Chosen by hand."""
_DECIDE = 3.0
"""Log odds that decide a contact: 20 to 1; chosen by hand."""
_SETTLE_S = 2.0
"""Time in clear view after which a contact that colours cannot decide is closed [s]; chosen by
hand."""


@dataclass
class Contact:
    """Two people whose tracks may have been exchanged."""

    people: tuple[Track, Track]
    galleries: tuple[Gallery, Gallery]
    confidences: tuple[float, float]
    touched_s: float
    evidence: float = 0.0
    looks: int = 0
    clear_s: float = 0.0

    def share_doubt(self, kept_log_odds: float) -> None:
        """Lower the confidence in both tracks by the probability that they were exchanged."""
        kept = 1 / (1 + math.exp(-kept_log_odds))
        for track, before in zip(self.people, self.confidences, strict=True):
            track.confidence = min(track.confidence, before * kept)
            track.runner_up = max(track.runner_up, before * (1 - kept))

    def kept_log_odds(self) -> float:
        """Log odds that the two were not exchanged, by motion and appearance."""
        kept = min(
            track.confidence / max(before, 1e-9)
            for track, before in zip(self.people, self.confidences, strict=True)
        )
        kept = min(max(kept, 1e-3), 1 - 1e-3)
        prior = min(max(math.log(kept / (1 - kept)), -_MOST_PRIOR), _MOST_PRIOR)
        return prior + self.looks_log_odds()

    def looks_log_odds(self) -> float:
        """The part of these log odds that appearance gives."""
        return self.evidence * min(1.0, _INDEPENDENT / max(self.looks, 1))


class Contacts:
    """All contacts that are not decided yet."""

    def __init__(self, looks: LookModel, trace: Trace | None = None) -> None:
        """Start without contacts."""
        self._looks = looks
        self._trace = trace or Trace()
        self._open: list[Contact] = []

    def among(self, track: Track) -> bool:
        """Whether the identity of a track is undecided."""
        return any(track in contact.people for contact in self._open)

    def touch(self, first: Track, second: Track, t_s: float) -> None:
        """Note that two people can be confused in this frame."""
        if first is second or not (first.gallery.looks and second.gallery.looks):
            return
        for contact in self._open:
            if first in contact.people and second in contact.people:
                contact.touched_s, contact.evidence, contact.looks = t_s, 0.0, 0
                contact.clear_s = 0.0
                return
        if self._trace.on:
            self._trace.note(Event("contact", id=first.track_id, other=second.track_id))
        self._open.append(
            Contact(
                (first, second),
                (first.gallery.copy(), second.gallery.copy()),
                (first.confidence_before, second.confidence_before),
                t_s,
            )
        )

    def decide(
        self, tracks: Sequence[Track], looks: FloatArray, known: set[int], t_s: float, dt_s: float
    ) -> None:
        """Compare the descriptors of people seen alone with galleries; close decided contacts.

        Args:
            tracks: people seen alone in this frame. looks: (N, D), their descriptors.
            known: `id()` of all tracks in sight or remembered.
            t_s: now. dt_s: seconds since the frame before.
        """
        undecided = []
        for contact in self._open:
            if not all(id(track) in known for track in contact.people):
                if self._trace.on:
                    self._trace.note(_decision(contact, contact.kept_log_odds(), decided=False))
                continue
            if contact.touched_s < t_s:
                self._look(contact, tracks, looks, dt_s)
            kept = contact.kept_log_odds()
            decided = contact.looks >= _LEAST_LOOKS and abs(kept) > _DECIDE
            if decided or contact.clear_s >= _SETTLE_S:
                exchanged = decided and kept < 0
                if self._trace.on:
                    self._trace.note(_decision(contact, kept, decided))
                _close(contact, kept, exchanged)
            else:
                contact.share_doubt(kept)
                undecided.append(contact)
        self._open = undecided[-_MOST_OPEN:]

    def _look(
        self, contact: Contact, tracks: Sequence[Track], looks: FloatArray, dt_s: float
    ) -> None:
        seen = [(k, contact.people.index(t)) for k, t in enumerate(tracks) if t in contact.people]
        if not seen:
            return
        odds = self._looks.compare(contact.galleries, looks[[k for k, _ in seen]])
        for column, (_, own) in enumerate(seen):
            told = float(odds[own, column] - odds[1 - own, column])
            contact.evidence += min(max(told, -_MOST_OF_ONE), _MOST_OF_ONE)
        contact.looks += 1
        contact.clear_s += dt_s


def _decision(contact: Contact, kept_log_odds: float, decided: bool) -> Event:
    """What is noted of a contact that is about to be closed."""
    first, second = contact.people
    exchanged = decided and kept_log_odds < 0
    looks = contact.looks_log_odds()
    return Event(
        "decided", id=first.track_id, other=second.track_id,
        outcome=("exchanged" if exchanged else "kept") if decided else "open",
        probability=probable(1 / (1 + math.exp(kept_log_odds if exchanged else -kept_log_odds))),
        motion_log_odds=bounded(kept_log_odds - looks), looks_log_odds=bounded(looks),
    )  # fmt: skip


def _close(contact: Contact, kept_log_odds: float, exchanged: bool) -> None:
    """Close a contact, and exchange ids and galleries if the tracks were exchanged."""
    sure = 1 / (1 + math.exp(kept_log_odds if exchanged else -kept_log_odds))
    names = [track.track_id for track in contact.people]
    for place, track in enumerate(contact.people):
        who = 1 - place if exchanged else place
        if exchanged:
            track.track_id, track.gallery = names[who], contact.galleries[who]
            track.vouched = None
        track.confidence = contact.confidences[who] * sure
        track.runner_up = 1 - sure


def pairs_in_doubt(sure: FloatArray, pairs: Sequence[tuple[int, int]], least: float) -> list[
    tuple[int, int]
]:  # fmt: skip
    """Pairs (track that got a box, other track that may own it) of at least that probability.

    Args:
        sure: (N, M) marginal probabilities of tracks and boxes. pairs: (track, box) as assigned.
        least: probability from which the other track counts.
    """
    found = []
    for i, j in pairs:
        for other in np.flatnonzero(sure[:, j] >= least).tolist():
            if other != i:
                found.append((i, other))
    return found
