"""Association of the people of a group with the parts into which its blob has fallen."""

from __future__ import annotations

from collections.abc import Sequence

from heel.services.geometry import boxes
from heel.services.tracker.paper.clusters import Cluster, slots_of
from heel.services.tracker.paper.features import extract
from heel.services.tracker.paper.identity import Retention, cost_matrix, retain
from heel.services.tracker.paper.lifecycle import Person
from heel.services.tracker.paper.settings import BlobSettings
from heel.services.tracker.paper.sighting import Sighting
from heel.services.tracker.trace import Event, Trace, probable

_UNINFORMATIVE = 1.0
"""Cost of a place among several people, whose pixels are mixed: the mean of all costs."""


def split(
    people: Sequence[Person],
    parts: Sequence[Sighting],
    settings: BlobSettings,
    trace: Trace | None = None,
) -> list[tuple[Cluster, Sighting]]:
    """Give each person to a part by the features from before the merge.

    Args:
        people: the group, all with reference features.
        parts: 2 to `len(people)` blobs.
        settings: sharpness of the identity confidence.
        trace: takes what is decided.

    Returns:
        Per part the people in it, identities decided and positions moved there.
    """
    slots = slots_of(parts, len(people))
    decision = _decide(people, parts, slots, settings)
    clusters = []
    for index, part in enumerate(parts):
        members = [
            person
            for person, slot in zip(people, decision.slots, strict=True)
            if slots[slot] == index
        ]
        for person in members:
            person.filter.place(boxes.kept_inside(person.box, part.box))
        clusters.append((Cluster(members, part.box), part))
    for person, confidence in zip(people, decision.confidence, strict=True):
        person.identified(confidence)
        if trace is not None and trace.on:
            sure = probable(confidence)
            trace.note(Event("assigned", id=person.id, outcome="kept", probability=sure))
    return clusters


def _decide(
    people: Sequence[Person],
    parts: Sequence[Sighting],
    slots: Sequence[int],
    settings: BlobSettings,
) -> Retention:
    current = [extract(part.pixels) for part in parts]
    references = [person.reference or {} for person in people]
    costs = cost_matrix(references, [current[slot] for slot in slots])
    for column, slot in enumerate(slots):
        if slots.count(slot) > 1:
            costs[:, column] = _UNINFORMATIVE
    return retain(costs, settings.identity_sharpness)
