"""People that were lost, and where they may be by now."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Collection
from dataclasses import dataclass

from heel.services.geometry.picture_motion import moved_point
from heel.services.tracker.evidence.appearance import Gallery
from heel.services.tracker.evidence.arrays import Floats, Foot
from heel.services.tracker.evidence.person import Person

_KEPT = 32
"""Lost people kept at most, the last ones: bounds memory and time; chosen by hand."""
_KEPT_S = 120.0
"""Seconds after which a lost person is no longer re-identified: by then it may be anywhere; chosen
by hand."""
_NEAR = 0.6
"""Heights from where a person was lost within which it may be found at once; chosen by hand."""
_SPEED = 1.2
"""Heights per second by which that distance grows: a fast walk, about 2 m/s; chosen by hand."""


@dataclass(eq=False)
class Lost:
    """A person that was lost; lengths in working pixels."""

    id: int
    gallery: Gallery
    foot: Foot
    height: float
    time_s: float
    confidence: float

    @classmethod
    def of(cls, person: Person, gallery: Gallery, now_s: float) -> Lost:
        """Where and when the person was seen last."""
        time_s = now_s - person.missed_s
        return cls(
            person.id, gallery, person.seen_foot, person.height, time_s, person.identity_confidence
        )

    def is_within_reach(self, person: Person, now_s: float) -> bool:
        """Whether the person, born since, stands where the lost one can have gone."""
        reach = _NEAR + _SPEED * max(now_s - self.time_s, 0.0)
        return math.dist(self.foot, person.foot) < reach * max(self.height, person.height)


class Memory:
    """The last people lost, oldest first."""

    def __init__(self) -> None:
        self._lost: OrderedDict[int, Lost] = OrderedDict()

    def add(self, lost: Lost) -> None:
        """Remember a person."""
        self._lost[lost.id] = lost
        while len(self._lost) > _KEPT:
            self._lost.popitem(last=False)

    def carry(self, affine: Floats) -> None:
        """Warp all places; (2, 3), old to new working pixels."""
        for lost in self._lost.values():
            lost.foot = moved_point(affine, lost.foot)

    def forget(self, ids: Collection[int]) -> None:
        """These are in view again."""
        for key in ids:
            self._lost.pop(key, None)

    def within_reach(self, person: Person, now_s: float) -> list[Lost]:
        """The lost people that the person can be."""
        recent = [lost for lost in self._lost.values() if now_s - lost.time_s < _KEPT_S]
        return [lost for lost in recent if lost.is_within_reach(person, now_s)]
