"""Identities: galleries of descriptors, contacts that are not decided yet, re-identification.

People that overlap may leave with each other's track. Their galleries rest from then on; once all
of them have been seen in the open again, their new appearance descriptors are compared with the
galleries from before, the paper's S1 against S2 (eq. 5 and 6) for any number of people. Where
neither appearance nor motion can tell, no track keeps the old id: a follower stops for a lost
person, and walks after a wrong one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from heel.services.tracker.evidence.appearance import Gallery, Look
from heel.services.tracker.evidence.arrays import Floats
from heel.services.tracker.evidence.contacts import group_of, meet, prior_nats
from heel.services.tracker.evidence.memory import Lost, Memory
from heel.services.tracker.evidence.odds import (
    UNKNOWN_NATS,
    Verdict,
    among,
    decide,
    look_nats,
)
from heel.services.tracker.evidence.person import CERTAIN, Person
from heel.services.tracker.trace import Event, Trace, probable

_KNOWN_LOOKS = 4
"""Descriptors in a gallery from which it is compared with: fewer may all be of one moment; chosen
by hand."""
_NEW_LOOKS = 3
"""Descriptors after a contact, or of a newcomer, from which an identity is decided: the median of
three bears one outlier."""
_MOST_LOOKS = 8
"""Descriptors after which an identity is decided for good: more hardly change their median, and the
track waits meanwhile; chosen by hand."""
_SURE = 0.6
"""Probability below which an identity is given up; chosen by hand."""
_CLEAR = 0.9
"""Probability below which more descriptors are waited for; chosen by hand."""
_RECALL_SURE = 0.9
"""Probability from which a newcomer is re-identified; a wrong re-identification leads a follower
astray, a missed one stops it; chosen by hand."""
_LOST_AFTER_S = 0.5
"""Seconds unseen after which a person counts as lost and may be re-identified: a gap that is no
longer the track bridges by itself; chosen by hand."""
_INSIDE_PRIOR = 0.5
"""Prior probability that a newcomer well inside the picture is one of the people lost within reach:
new people come from the border, so that chances are even; chosen by hand."""
_BORDER_PRIOR = 0.1
"""The same prior for a newcomer at the border, where new people come in; chosen by hand."""


class Ids:
    """Numbers for people, never the same twice."""

    def __init__(self, first: int) -> None:
        self.next = first

    def take(self) -> int:
        """A number that was never used."""
        self.next += 1
        return self.next - 1


class Identities:
    """Galleries by identity, contacts that are not decided yet, and the people that are lost."""

    def __init__(self, ids: Ids, trace: Trace | None = None) -> None:
        self._ids = ids
        self._trace = trace or Trace()
        self._galleries: dict[int, Gallery] = {}
        self._memory = Memory()

    def meet(self, people: Sequence[Person], ratio: float, dt_s: float) -> None:
        """Note contacts of this frame."""
        meet(people, ratio, dt_s, self._trace)

    def see(self, person: Person, look: Look) -> None:
        """Learn a descriptor of a person in the open, or keep it until a contact is decided."""
        if person.rivals or person.is_newcomer:
            person.looks.append(look)
            del person.looks[:-_MOST_LOOKS]
        else:
            self._gallery(person).add(look)

    def decide(self, people: Sequence[Person], now_s: float) -> None:
        """Settle contacts of which all people have been seen in the open since, or are gone."""
        self._keep_lost(people, now_s)
        self._settle_contacts(people, now_s)
        for person in people:
            if person.is_newcomer and not person.rivals and len(person.looks) >= _NEW_LOOKS:
                self._welcome(person, people, now_s)
        wanted = {person.id for person in people}.union(*(person.rivals for person in people))
        self._galleries = {key: value for key, value in self._galleries.items() if key in wanted}

    def carry(self, affine: Floats) -> None:
        """Warp the places where people were lost; (2, 3), old to new working pixels."""
        self._memory.carry(affine)

    def give_up(self, person: Person, people: Sequence[Person]) -> None:
        """The id stood for more than one person: a new one, and a new gallery with it."""
        old, new = person.id, self._ids.take()
        if self._trace.on:
            left = probable(person.identity_confidence)
            self._trace.note(
                Event("given up", id=old, other=new, cause="newcomer", probability=left)
            )
        self._galleries.pop(old, None)
        person.rename(new)
        person.looks.clear()
        for other in people:
            if old in other.rivals:
                other.rivals[new] = other.rivals.pop(old)

    def _keep_lost(self, people: Sequence[Person], now_s: float) -> None:
        """Galleries of people that are missed are kept for long, for they may come back."""
        for person in people:
            if person.missed_frames == 0:
                self._memory.forget({person.id})
            elif person.missed_s > _LOST_AFTER_S and self._knows(person.id):
                self._memory.add(Lost.of(person, self._galleries[person.id], now_s))

    def _settle_contacts(self, people: Sequence[Person], now_s: float) -> None:
        for person in people:
            if not person.rivals:
                continue
            by_id = {each.id: each for each in people}  # settling changes ids
            group = group_of(person, by_id)
            members = [by_id[key] for key in group if key in by_id]
            if all(len(member.looks) >= _NEW_LOOKS for member in members):
                before = {member.id for member in members}
                self._settle(members, [key for key in group if key not in by_id], now_s)
                found = {member.id for member in members} - before
                for each in people:  # no other person can be those any more
                    for key in found:
                        each.rivals.pop(key, None)

    def _settle(self, group: Sequence[Person], gone: Sequence[int], now_s: float) -> None:
        """Decide the identities of a group; each may also be one of the people that are gone.

        While that is not sure, more descriptors are waited for.
        """
        ids = [person.id for person in group] + [key for key in gone if self._knows(key)]
        nats = np.array([[self._nats(person, key) for key in ids] for person in group])
        strangers = [UNKNOWN_NATS - math.log(1.01 - each.identity_confidence) for each in group]
        verdicts = decide(nats, strangers)
        sure = all(verdict.confidence > _CLEAR for verdict in verdicts)
        if not sure and any(len(person.looks) < _MOST_LOOKS for person in group):
            return
        galleries = {key: self._galleries[key] for key in ids if self._knows(key)}
        for person, verdict in zip(group, verdicts, strict=True):
            person.rivals.clear()
            if verdict.confidence < _SURE:
                if person.id in galleries:
                    self._memory.add(Lost.of(person, galleries[person.id], now_s))
                before = person.id
                person.rename(self._ids.take())
                self._note_verdict(before, person.id, ids, verdict)
            else:
                self._note_verdict(person.id, ids[verdict.column], ids, verdict)
                person.id = ids[verdict.column]
                person.identity_confidence = min(verdict.confidence, CERTAIN)
                person.runner_up_confidence = verdict.runner_up
        for person in group:
            self._memory.forget({person.id})
            if not person.is_newcomer:
                self._learn(person)

    def _note_verdict(self, before: int, after: int, ids: Sequence[int], verdict: Verdict) -> None:
        """Note which id a person has after a contact: one of those known, or a fresh one."""
        if not self._trace.on:
            return
        sure, rest = probable(verdict.confidence), probable(verdict.runner_up)
        second = ids[verdict.second] if verdict.second >= 0 else 0
        if after not in ids:
            event = Event("given up", id=before, other=after, cause="contact", probability=sure,
                          runner_up=second, runner_up_probability=rest)  # fmt: skip
        else:
            event = Event("assigned", id=before, other=0 if after == before else after,
                          outcome="kept" if after == before else "exchanged", probability=sure,
                          runner_up=second, runner_up_probability=rest)  # fmt: skip
        self._trace.note(event)

    def _nats(self, person: Person, key: int) -> float:
        """Negative log of the probability that the person has this id, up to a constant."""
        if not self._knows(key):
            return UNKNOWN_NATS + prior_nats(person, key)
        return look_nats(self._distance(self._galleries[key], person)) + prior_nats(person, key)

    def _learn(self, person: Person) -> None:
        for look in person.looks:
            self._gallery(person).add(look)
        person.looks.clear()

    def _welcome(self, person: Person, people: Sequence[Person], now_s: float) -> None:
        """Re-identify a newcomer, or not; after a few descriptors that is decided for good."""
        lost = self._memory.within_reach(person, now_s)
        if lost:
            nats = [look_nats(self._distance(each.gallery, person)) for each in lost]
            verdict = among(nats, _BORDER_PRIOR if person.born_at_border else _INSIDE_PRIOR)
            sure = verdict.confidence >= _RECALL_SURE
            if self._trace.on and (sure or len(person.looks) >= _MOST_LOOKS):
                self._trace.note(_comparison(person, lost, verdict, sure))
            if sure:
                self._recall(person, lost[verdict.column], verdict, people)
        if not lost or len(person.looks) >= _MOST_LOOKS:
            person.is_newcomer = False
        if not person.is_newcomer:
            self._learn(person)

    def _recall(
        self, person: Person, lost: Lost, verdict: Verdict, people: Sequence[Person]
    ) -> None:
        for other in people:
            if other.id == lost.id:
                other.is_replaced = True
                person.rivals |= other.rivals
                other.rivals.clear()
        person.id = lost.id
        person.is_newcomer = False
        person.identity_confidence = verdict.confidence * lost.confidence
        person.runner_up_confidence = verdict.runner_up
        self._galleries[lost.id] = lost.gallery
        self._memory.forget({lost.id})

    def _gallery(self, person: Person) -> Gallery:
        return self._galleries.setdefault(person.id, Gallery())

    def _knows(self, key: int) -> bool:
        gallery = self._galleries.get(key)
        return gallery is not None and len(gallery) >= _KNOWN_LOOKS

    def _distance(self, gallery: Gallery, person: Person) -> float:
        return float(np.median([gallery.distance(look) for look in person.looks]))


def _comparison(person: Person, lost: Sequence[Lost], verdict: Verdict, sure: bool) -> Event:
    """What is noted of a newcomer that was compared with people out of sight."""
    best = lost[verdict.column].id
    probability = probable(verdict.confidence)
    if not sure:
        return Event("new", id=person.id, runner_up=best, runner_up_probability=probability)
    second = 0 if verdict.second < 0 else lost[verdict.second].id
    return Event(
        "re-identified", id=best, other=person.id, probability=probability, runner_up=second,
        runner_up_probability=probable(verdict.runner_up),
    )  # fmt: skip
