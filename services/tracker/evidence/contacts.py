"""Contacts of people, after which the tracks of two may have been exchanged."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from heel.services.geometry.boxes import cover_of_smaller
from heel.services.tracker.evidence.person import Person
from heel.services.tracker.trace import Event, Trace

_CONTACT = 0.25
"""Share of the smaller overlap of two boxes from which two people are in contact."""
_HIDDEN = 0.8
"""Share of a person in view below which the contact hides the person: as `person._FREE_VIEW`;
chosen by hand."""
TOUCH = 0.003
"""Prior probability that two people bear each other's id after a contact in which both stayed in
view: tracks of people in view are hardly ever exchanged; chosen by hand."""
_MIXED_S = 5.0
"""Seconds of occlusion after which the tracks are exchanged with a probability of one half but for
1/e of it: crossings of half a second seldom exchange them, long ones leave nothing to
tell by; chosen by hand."""


def meet(people: Sequence[Person], ratio: float, dt_s: float, trace: Trace | None = None) -> None:
    """Note contacts of this frame; appearance descriptors from before them count no more."""
    boxes = [person.box(ratio) for person in people]
    for first, person in enumerate(people):
        for second in range(first):
            other = people[second]
            if cover_of_smaller(boxes[first], boxes[second]) <= _CONTACT:
                continue
            if trace is not None and trace.on and other.id not in person.rivals:
                trace.note(Event("contact", id=other.id, other=person.id))
            hidden_s = dt_s if min(person.in_view, other.in_view) < _HIDDEN else 0.0
            for one, rival in ((person, other), (other, person)):
                odds = max(TOUCH, one.rivals.get(rival.id, 0.0))
                one.rivals[rival.id] = 0.5 - (0.5 - odds) * math.exp(-hidden_s / _MIXED_S)
                one.looks.clear()


def group_of(person: Person, by_id: Mapping[int, Person]) -> list[int]:
    """Ids of all people connected by undecided contacts, also of those that are gone."""
    group, todo = {person.id}, [person.id]
    while todo:
        member = by_id.get(todo.pop())
        fresh = member.rivals.keys() - group if member else set()
        group |= fresh
        todo += sorted(fresh)
    return sorted(group)


def prior_nats(person: Person, key: int) -> float:
    """Negative log of the prior that the person is the one that has, or had, this id."""
    # An exchange is two people in the wrong place: each bears half of it, and of there being none.
    if key == person.id:
        stayed = math.prod(1.0 - odds for odds in person.rivals.values())
        return -math.log(person.identity_confidence) - 0.5 * math.log(stayed)
    return -0.5 * math.log(person.rivals.get(key, TOUCH**2))
