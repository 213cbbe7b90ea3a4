"""Identities of two people after a contact: the paper's decision at the split, by appearance and
by place.

While two people can be confused, their galleries stay as they were before, and a copy of each
goes on as the filter predicts from before, without boxes. Once both, or one of them, are seen alone
again, each appearance descriptor is compared with both galleries, and each box with both copies:
who walks on towards the camera does not go back to the size of who walks away. If the two kinds of
evidence decide that the tracks were exchanged, the ids are exchanged back; if they cannot decide,
as with twins that part slowly, the doubt stays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from heel.services.tracker.people.association import in_heights, log_student
from heel.services.tracker.people.geometry import FloatArray
from heel.services.tracker.people.looks import Gallery, LookModel
from heel.services.tracker.people.measured import Measurement
from heel.services.tracker.people.track import Track
from heel.services.tracker.trace import Event, Trace, bounded, probable

_LEAST_LOOKS = 2
"""Frames with a descriptor before a contact is decided; chosen by hand."""
_LEAST_CLEAR_S = 0.2
"""Time in clear view before a contact is decided [s]: the first boxes after an overlap still hold
parts of both; chosen by hand."""
_INDEPENDENT_HZ = 4.0
"""Descriptors per second that count as independent, as those of neighbouring frames show the same
side in the same light; chosen by hand."""
_INDEPENDENT = 4.0
"""Descriptors up to which evidence adds up, likewise; chosen by hand."""
_MOST_OF_ONE = 4.0
"""Most log odds of one descriptor: one in some twenty holds pixels of another person or a lamp
post; chosen by hand."""
_MOST_MOTION = 4.0
"""Most log odds that either the association or the places at the split can give; chosen by hand."""
_ASSOCIATION = 0.5
"""Weight of the association's log odds beside those of places, which come of the same boxes; chosen
by hand."""
_MOST_OPEN = 64
"""Most undecided contacts: of more the oldest are left undecided. Chosen by hand."""
_DECIDE = 3.0
"""Log odds that decide a contact: 20 to 1; chosen by hand."""
_SETTLE_S = 2.0
"""Time in clear view after which a contact that colours cannot decide is closed [s]; chosen by
hand."""


@dataclass
class Contact:
    """Two people whose tracks may have been exchanged.

    Attributes:
        people: the two tracks.
        galleries, confidences: theirs of before.
        ahead: copies of both that go on from before, without boxes.
        touched_s: when they could last be confused.
        evidence: sum of the log odds of descriptors since, that both stayed.
        looks, clear_s: frames and time in which either was seen alone since.
        places: log odds of the newest box of either since, likewise; None: none was seen.
    """

    people: tuple[Track, Track]
    galleries: tuple[Gallery, Gallery]
    confidences: tuple[float, float]
    ahead: tuple[Track, Track]
    touched_s: float
    evidence: float = 0.0
    looks: int = 0
    clear_s: float = 0.0
    places: list[float | None] = field(default_factory=lambda: [None, None])

    def begin_again(self, t_s: float) -> None:
        """The two can be confused again: what was seen of them since the last time is void."""
        self.touched_s, self.evidence, self.looks, self.clear_s = t_s, 0.0, 0, 0.0
        self.places = [None, None]

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
        association = _within(math.log(kept / (1 - kept)), _MOST_MOTION)
        places = [log_odds for log_odds in self.places if log_odds is not None]
        if not places:
            return association + self.looks_log_odds()
        motion = _ASSOCIATION * association + _within(sum(places), _MOST_MOTION)
        return motion + self.looks_log_odds()

    def looks_log_odds(self) -> float:
        """The part of these log odds that appearance gives."""
        count = min(self.looks, self.clear_s * _INDEPENDENT_HZ, _INDEPENDENT)
        return self.evidence / max(self.looks, 1) * count


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
                contact.begin_again(t_s)
                return
        self._trace.note(Event("contact", id=first.track_id, other=second.track_id))
        self._open.append(
            Contact(
                (first, second),
                (first.gallery.copy(), second.gallery.copy()),
                (first.confidence_before, second.confidence_before),
                (first.as_predicted(), second.as_predicted()),
                t_s,
            )
        )

    def go_on(self, known: Track, newcomer: Track) -> None:
        """Leave open which of two it is that is back, if that was open when they went out of sight.

        Args:
            known: the track out of sight, which may have been exchanged with one still in view.
            newcomer: the track that is taken to be that person's.
        """
        for contact in self._open:
            first, second = (newcomer if track is known else track for track in contact.people)
            contact.people = first, second
        self._open = [one for one in self._open if one.people[0] is not one.people[1]]

    def ahead(self) -> list[Track]:
        """The copies of all people in contact, to be predicted with the tracks."""
        return [copy for contact in self._open for copy in contact.ahead]

    def decide(
        self, seen: Sequence[Measurement], looks: FloatArray, known: set[int], t_s: float,
        elapsed_s: float,
    ) -> None:  # fmt: skip
        """Compare what is seen of people alone with what is known of before; close the decided.

        Args:
            seen: people seen alone in this frame. looks: (N, D), their descriptors.
            known: `id()` of all tracks in sight or remembered.
            t_s: now. elapsed_s: since the frame before.
        """
        undecided = []
        for contact in self._open:
            if not all(id(track) in known for track in contact.people):
                self._trace.note(_decision(contact, contact.kept_log_odds(), decided=False))
                continue
            if contact.touched_s < t_s:
                self._compare(contact, seen, looks, elapsed_s)
            kept = contact.kept_log_odds()
            enough = contact.looks >= _LEAST_LOOKS and contact.clear_s >= _LEAST_CLEAR_S
            decided = enough and abs(kept) > _DECIDE
            if decided or contact.clear_s >= _SETTLE_S:
                exchanged = decided and kept < 0
                self._trace.note(_decision(contact, kept, decided))
                _close(contact, kept, exchanged)
            else:
                contact.share_doubt(kept)
                undecided.append(contact)
        self._open = undecided[-_MOST_OPEN:]

    def _compare(
        self, contact: Contact, seen: Sequence[Measurement], looks: FloatArray, elapsed_s: float
    ) -> None:
        here = [k for k, one in enumerate(seen) if one.track in contact.people]
        if not here:
            return
        odds = self._looks.compare(contact.galleries, looks[here])
        placed = all(copy.is_somewhere() for copy in contact.ahead)
        for column, k in enumerate(here):
            own = contact.people.index(seen[k].track)
            told = float(odds[own, column] - odds[1 - own, column])
            contact.evidence += _within(told, _MOST_OF_ONE)
            if placed:
                density = _log_density(contact.ahead, seen[k])
                contact.places[own] = float(density[own] - density[1 - own])
        contact.looks += 1
        contact.clear_s += elapsed_s


def _log_density(ahead: Sequence[Track], seen: Measurement) -> FloatArray:
    """Log density (N,) of a measurement about the states of tracks."""
    mean = np.stack([track.mean[:, 0] for track in ahead])
    variance = np.stack([track.covariance[:, 0, 0] for track in ahead]) + seen.variance
    scale = in_heights(np.exp(mean[:, 2]))
    residual = (seen.value - mean) / scale
    return log_student(residual[:, None], (variance / scale**2)[:, None])[0][:, 0]


def _within(log_odds: float, most: float) -> float:
    return min(max(log_odds, -most), most)


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
