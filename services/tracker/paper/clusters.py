"""People that share one blob, and the parts into which a shared blob falls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heel.schemas.base import BoxXyxy
from heel.services.geometry import boxes
from heel.services.tracker.paper.lifecycle import Person
from heel.services.tracker.paper.settings import BlobSettings
from heel.services.tracker.paper.sighting import Sighting

PART_COVER = 0.5
"""Share of a blob within the reach of a group from which it is a part of it: the larger half;
chosen by hand."""
_REACH = 0.25
"""Mean heights of its people by which the reach of a group exceeds its expected box, as they part;
chosen by hand."""


@dataclass(slots=True, eq=False)
class Cluster:
    """One person, or several under one blob; `box` is where that blob is expected."""

    people: list[Person]
    box: BoxXyxy

    @property
    def is_group(self) -> bool:
        """Whether several people share the blob."""
        return len(self.people) > 1

    @property
    def is_confirmed(self) -> bool:
        """Whether all people in it count."""
        return all(person.confirmed for person in self.people)

    @property
    def mean_height(self) -> float:
        """Of the people's boxes, pixels."""
        return float(np.mean([boxes.height(person.box) for person in self.people]))

    def take_in(self, other: Cluster) -> None:
        """People of another cluster now share this one's blob."""
        self.people.extend(other.people)

    def predict(self, dt_s: float) -> None:
        """Move the people ahead by `dt_s` seconds, and the expected blob with them."""
        for person in self.people:
            person.filter.predict(dt_s)
        if not self.is_group:
            self.box = self.people[0].box
            return
        velocity = np.mean([person.filter.velocity_pxps for person in self.people], axis=0)
        self.box = boxes.moved(self.box, float(velocity[0] * dt_s), float(velocity[1] * dt_s))


def parts_of(
    cluster: Cluster,
    matched: Sighting | None,
    free: Sequence[Sighting],
    settings: BlobSettings,
) -> list[Sighting]:
    """The blobs a group has fallen into: its matched one and free ones within its reach.

    Blobs too low for a person are fragments, not parts.
    """
    reach = _REACH * cluster.mean_height
    left, top, right, bottom = cluster.box
    region = (left - reach, top - reach, right + reach, bottom + reach)
    near = [sighting for sighting in free if boxes.cover(sighting.box, region) >= PART_COVER]
    low = settings.min_part_height * cluster.mean_height
    parts = [sighting for sighting in near if boxes.height(sighting.box) >= low]
    return ([matched] if matched is not None else []) + parts


def slots_of(parts: Sequence[Sighting], people: int) -> list[int]:
    """For each person's slot the part it belongs to; every part has at least one.

    With fewer parts than people the largest parts hold several: each further slot goes to the
    part with the most area per slot.
    """
    slots = list(range(len(parts)))
    areas = [boxes.area(part.box) for part in parts]
    while len(slots) < people:
        room = [area / (slots.count(part) + 0.5) for part, area in enumerate(areas)]
        slots.append(int(np.argmax(room)))
    return sorted(slots)


def hiding_blob(
    cluster: Cluster, sightings: Sequence[Sighting], settings: BlobSettings
) -> Sighting | None:
    """The blob that covers most of an unmatched cluster's people, if enough of them."""
    if not sightings:
        return None
    covers = [boxes.cover(cluster.box, sighting.box) for sighting in sightings]
    best = int(np.argmax(covers))
    return sightings[best] if covers[best] >= settings.min_cover else None
