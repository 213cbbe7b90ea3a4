"""Who may have left with whose track."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from heel.services.geometry.boxes import cover_of_smaller
from heel.services.tracker.fitted.person import Person

_CONTACT = 0.25
"""Share of the smaller overlap of two boxes from which two people are in contact."""
_HIDDEN = 0.8
TOUCH = 0.003
"""Probability that two people who met and stayed in view bear each other's id: none of 20 did."""
_MIXED_S = 5.0
"""Behind one another for this long, chances are even but for 1/e: 1 of 47 crossings of about half a
second exchanged the tracks."""


def meet(people: Sequence[Person], ratio: float, dt_s: float) -> None:
    """Note who is in contact with whom in this frame; looks from before it count no more."""
    boxes = [person.box(ratio) for person in people]
    for first, person in enumerate(people):
        for second in range(first):
            other = people[second]
            if cover_of_smaller(boxes[first], boxes[second]) <= _CONTACT:
                continue
            hidden_s = dt_s if min(person.in_view, other.in_view) < _HIDDEN else 0.0
            for one, rival in ((person, other), (other, person)):
                odds = max(TOUCH, one.rivals.get(rival.id, 0.0))
                one.rivals[rival.id] = 0.5 - (0.5 - odds) * math.exp(-hidden_s / _MIXED_S)
                one.looks.clear()


def group_of(person: Person, by_id: Mapping[int, Person]) -> list[int]:
    """Ids of everybody connected by undecided contacts, also of those who are gone."""
    group, todo = {person.id}, [person.id]
    while todo:
        member = by_id.get(todo.pop())
        fresh = member.rivals.keys() - group if member else set()
        group |= fresh
        todo += sorted(fresh)
    return sorted(group)


def prior_nats(person: Person, key: int) -> float:
    """Negative log-probability that the person is who has, or had, this id."""
    # An exchange is two people in the wrong place: each bears half of it, and of there being none.
    if key == person.id:
        stayed = math.prod(1.0 - odds for odds in person.rivals.values())
        return -math.log(person.identity_confidence) - 0.5 * math.log(stayed)
    return -0.5 * math.log(person.rivals.get(key, TOUCH**2))
