"""Who is who after two people met: the paper's question at the split, asked of their looks.

While two people can be taken for each other, their galleries stay as they were before. Once both,
or one of them, are seen alone again, each look is held against both galleries. If the looks say
that the two have changed places, they change their ids back; if they cannot tell, as with twins,
the doubt that motion left stays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heel.services.tracker.given_boxes.geometry import FloatArray
from heel.services.tracker.given_boxes.looks import Gallery, LookModel
from heel.services.tracker.given_boxes.track import Track

_LEAST_LOOKS = 2
"""Frames with a descriptor before a contact is decided; chosen by hand."""
_INDEPENDENT = 4.0
"""Descriptors of neighbouring frames repeat each other: more count no more."""
_MOST_PRIOR = 4.0
"""Most log odds that motion alone can give; chosen by hand."""
_MOST_OPEN = 64
"""Bound of the undecided contacts: of more people the oldest are left undecided."""
_DECIDE = 3.0
"""Log odds that decide a contact: 20 to 1."""
_SETTLE_S = 2.0
"""Time in clear view after which a contact that colours cannot decide is closed."""


@dataclass
class Contact:
    """Two people who may have been exchanged."""

    people: tuple[Track, Track]
    galleries: tuple[Gallery, Gallery]
    confidences: tuple[float, float]
    touched_s: float
    evidence: float = 0.0
    looks: int = 0
    clear_s: float = 0.0

    def share_doubt(self, kept_log_odds: float) -> None:
        """If one of the two may be the other, so may the other be the one."""
        kept = 1 / (1 + math.exp(-kept_log_odds))
        for track, before in zip(self.people, self.confidences, strict=True):
            track.confidence = min(track.confidence, before * kept)
            track.runner_up = max(track.runner_up, before * (1 - kept))

    def kept_log_odds(self) -> float:
        """Log odds that the two were not exchanged, by motion and looks."""
        kept = min(
            track.confidence / max(before, 1e-9)
            for track, before in zip(self.people, self.confidences, strict=True)
        )
        kept = min(max(kept, 1e-3), 1 - 1e-3)
        prior = min(max(math.log(kept / (1 - kept)), -_MOST_PRIOR), _MOST_PRIOR)
        return prior + self.evidence * min(1.0, _INDEPENDENT / max(self.looks, 1))


class Contacts:
    """All contacts that are not decided yet."""

    def __init__(self, looks: LookModel) -> None:
        """Start with nobody near anybody."""
        self._looks = looks
        self._open: list[Contact] = []

    def among(self, track: Track) -> bool:
        """Whether it is open who this is."""
        return any(track in contact.people for contact in self._open)

    def touch(self, first: Track, second: Track, t_s: float) -> None:
        """Note that two people can be taken for each other in this frame."""
        if first is second or not (first.gallery.looks and second.gallery.looks):
            return
        for contact in self._open:
            if first in contact.people and second in contact.people:
                contact.touched_s, contact.evidence, contact.looks = t_s, 0.0, 0
                contact.clear_s = 0.0
                return
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
        """Hold the looks of people seen alone against the galleries, and close what is clear.

        Args:
            tracks: people seen alone in this frame. looks: (N, D), theirs.
            known: `id()` of everybody who is in sight or remembered.
            t_s: now. dt_s: seconds since the frame before.
        """
        undecided = []
        for contact in self._open:
            if not all(id(track) in known for track in contact.people):
                continue
            if contact.touched_s < t_s:
                self._look(contact, tracks, looks, dt_s)
            odds = contact.kept_log_odds()
            decided = contact.looks >= _LEAST_LOOKS and abs(odds) > _DECIDE
            if decided or contact.clear_s >= _SETTLE_S:
                _close(contact, odds, exchanged=decided and odds < 0)
            else:
                contact.share_doubt(odds)
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
            contact.evidence += float(odds[own, column] - odds[1 - own, column])
        contact.looks += 1
        contact.clear_s += dt_s


def _close(contact: Contact, kept_log_odds: float, exchanged: bool) -> None:
    """Believe what was found, and give both their own ids and galleries if they had changed."""
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
        least: probability from which the other one is in the running.
    """
    found = []
    for i, j in pairs:
        for other in np.flatnonzero(sure[:, j] >= least).tolist():
            if other != i:
                found.append((i, other))
    return found
