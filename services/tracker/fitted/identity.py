"""Who is who after a contact: the paper's S1 against S2 (eq. 5 and 6) for any number of people.

People who overlap may leave with each other's track. Their galleries rest from then on; once
all of them have been seen in the open again, their new looks are compared with the galleries
from before, and the cheapest assignment (Kuhn-Munkres) decides. Identities change hands only
where that is clearly cheaper.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from services.tracker.fitted.appearance import Gallery, Look
from services.tracker.fitted.arrays import Floats, overlap
from services.tracker.fitted.person import Person

_CONTACT = 0.25
"""Share of the smaller overlap of two boxes from which two people are in contact."""
_KNOWN_LOOKS, _NEW_LOOKS, _MOST_LOOKS = 4, 3, 8
_CLEARLY = 0.05
"""Distance a person, by which another assignment has to be cheaper."""
_SOFTNESS = 0.03
_IMPOSSIBLE = 1e3


class Identities:
    """Galleries by identity, and the contacts that are not decided yet."""

    def __init__(self) -> None:
        self._galleries: dict[int, Gallery] = {}

    def meet(self, people: Sequence[Person], ratio: float) -> None:
        """Note who is in contact with whom in this frame."""
        boxes = [person.box(ratio) for person in people]
        for first, person in enumerate(people):
            for second in range(first):
                other = people[second]
                if overlap(boxes[first], boxes[second])[1] > _CONTACT:
                    for one, rival in ((person, other), (other, person)):
                        one.rivals.add(rival.id)
                        one.looks.clear()

    def see(self, person: Person, look: Look) -> None:
        """A look of somebody in the open: learned at once, or kept until a contact is decided."""
        if person.rivals:
            person.looks.append(look)
            del person.looks[:-_MOST_LOOKS]
        else:
            self._galleries.setdefault(person.id, Gallery()).add(look)

    def decide(self, people: Sequence[Person]) -> None:
        """Settle the contacts of those who have all been seen in the open since, or are gone."""
        for person in people:
            if person.rivals:
                by_id = {each.id: each for each in people}  # settling changes ids
                group = _group(person, by_id)
                members = [by_id[key] for key in group if key in by_id]
                if all(len(member.looks) >= _NEW_LOOKS for member in members):
                    self._settle(members, [key for key in group if key not in by_id])
                    taken = {member.id for member in members} - by_id.keys()
                    for each in people:  # nobody else can be those any more
                        each.rivals -= taken
        wanted = {person.id for person in people}.union(*(person.rivals for person in people))
        self._galleries = {key: value for key, value in self._galleries.items() if key in wanted}

    def _settle(self, group: Sequence[Person], gone: Sequence[int]) -> None:
        """Decide who of a group is who; each may also be one of those who are gone."""
        known = [person for person in group if self._knows(person.id)]
        ids = [person.id for person in known] + [key for key in gone if self._knows(key)]
        if known and len(ids) > 1:
            costs = self._costs(ids, known)
            for person, (owner, confidence) in zip(known, _decision(costs), strict=True):
                person.id = ids[owner]
                person.identity_confidence *= confidence
                person.runner_up_confidence = 1.0 - confidence
        for person in group:
            gallery = self._galleries.setdefault(person.id, Gallery())
            for look in person.looks:
                gallery.add(look)
            person.rivals.clear()
            person.looks.clear()

    def _knows(self, key: int) -> bool:
        gallery = self._galleries.get(key)
        return gallery is not None and len(gallery) >= _KNOWN_LOOKS

    def _costs(self, ids: Sequence[int], people: Sequence[Person]) -> Floats:
        """Mean distance of each person's new looks to each gallery, (people, galleries)."""
        return np.array(
            [
                [np.mean([self._galleries[key].distance(look) for look in person.looks])
                 for key in ids]
                for person in people
            ]
        )  # fmt: skip


def _group(person: Person, by_id: dict[int, Person]) -> list[int]:
    """Ids of everybody connected by undecided contacts, also of those who are gone."""
    group, todo = {person.id}, [person.id]
    while todo:
        member = by_id.get(todo.pop())
        fresh = member.rivals - group if member else set()
        group |= fresh
        todo += sorted(fresh)
    return sorted(group)


def _decision(costs: Floats) -> list[tuple[int, float]]:
    """For each person the gallery, and how sure that is, 0 to 1."""
    count = len(costs)
    stay = np.arange(count)
    best = linear_sum_assignment(costs)[1]
    clearly = (costs[stay, stay].sum() - costs[stay, best].sum()) / count > _CLEARLY
    chosen = best if clearly else stay
    total = float(costs[stay, chosen].sum())
    decision = []
    for row, column in enumerate(chosen):
        without = costs.copy()
        without[row, column] = _IMPOSSIBLE
        other = float(without[linear_sum_assignment(without)].sum())
        margin = (other - total) / count
        decision.append((int(column), 1.0 / (1.0 + math.exp(-min(margin / _SOFTNESS, 50.0)))))
    return decision
