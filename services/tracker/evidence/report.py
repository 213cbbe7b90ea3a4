"""People in working pixels, as reports in frame pixels."""

from __future__ import annotations

import math
from collections.abc import Sequence

from heel.schemas import Blobs
from heel.schemas.base import BoxXyxy
from heel.services.geometry.boxes import cover
from heel.services.tracker.evidence.person import Person
from heel.services.tracker.evidence.scale import SceneScale
from heel.services.tracker.report import Report
from heel.services.tracker.settings import Reporting

_SIDE = 0.03
"""Share of the width by which the box exceeds the silhouette on each side, as arms reach out;
chosen by hand."""
_BELOW = 0.02
"""Share of the height by which the box exceeds the foot point, as the nearer foot stands lower;
chosen by hand."""
OCCLUDED_BELOW = 0.5
"""Share of the silhouette in view below which a person is occluded: as `Report.alone` says."""
_CUT_STANDING = 0.05
"""Share of a far person's height that the upper edge may cut off for a standing camera, which sees
the far end of the scene there: more of it costs MOTA on Town Centre."""
_CUT_MOVING = 0.4
"""The same for a moving camera, which sees anything there when it tilts: less of it costs MOTA on a
panned window of PETS09-S2L1."""
_DOUBT_S = 4.0
"""Seconds unseen in which the confidence falls to 1/e; chosen by hand."""


class Reporter:
    """Says in frame pixels what is known in working pixels."""

    def __init__(
        self, blobs: Blobs, shape: tuple[int, ...], scale: SceneScale, reporting: Reporting
    ) -> None:
        self._scale_x, self._scale_y = blobs.width / shape[1], blobs.height / shape[0]
        self._scale = scale
        self._reporting = reporting
        self._may_be_cut = _CUT_STANDING if blobs.camera_motion is None else _CUT_MOVING

    def reports(self, people: Sequence[Person]) -> list[Report]:
        """Reports of all known people."""
        return [self._report(person, people) for person in people]

    def _report(self, person: Person, people: Sequence[Person]) -> Report:
        vx, vy = person.filter.velocity
        rise = vy * (1.0 - 0.5 * self._scale.line.slope)
        return Report(
            id=person.id,
            box_xyxy=self._box(person),
            velocity_pxps=(vx * self._scale_x, rise * self._scale_y),
            confirmed=person.confirmed,
            alone=person.missed_frames == 0 and person.in_view >= OCCLUDED_BELOW,
            missed_frames=person.missed_frames,
            in_front=self._in_front(person, people),
            identity_confidence=_confidence(person),
            runner_up_confidence=person.runner_up_confidence,
            shown=self._is_shown(person),
        )

    def _box(self, person: Person) -> BoxXyxy:
        left, top, right, bottom = person.box(self._scale.ratio)
        side, below = _SIDE * (right - left), _BELOW * (bottom - top)
        return (
            (left - side) * self._scale_x,
            top * self._scale_y,
            (right + side) * self._scale_x,
            (bottom + below) * self._scale_y,
        )

    def _is_shown(self, person: Person) -> bool:
        """Hidden people are shown longer than people that are simply not where they should be.

        Far people must be large enough and have their heads in view; near ones may be cut.
        """
        hidden = person.in_view < OCCLUDED_BELOW
        patience_s = self._reporting.show_missed_s * (1.0 if hidden else 0.5)
        rows = self._scale.rows
        head = person.foot[1] - person.height
        whole = head > -self._may_be_cut * person.height or person.height > 0.5 * rows
        large = person.height > self._reporting.min_height * rows
        return person.confirmed and person.missed_s <= patience_s and whole and large

    def _in_front(self, person: Person, people: Sequence[Person]) -> tuple[int, ...]:
        """The occluder: the nearer person that covers most of one that is hardly in view."""
        if person.in_view >= OCCLUDED_BELOW:
            return ()
        ratio = self._scale.ratio
        box = person.box(ratio)
        covers = [
            (cover(box, other.box(ratio)), -other.id)
            for other in people
            if other is not person and (other.foot[1], -other.id) > (person.foot[1], -person.id)
        ]
        most = max(covers, default=(0.0, 0))
        return (-most[1],) if most[0] > 0.0 else ()


def _confidence(person: Person) -> float:
    """That the id is still on the same person: contacts, decided or not, and time unseen."""
    exchanged = math.prod(1.0 - odds for odds in person.rivals.values())
    return person.identity_confidence * exchanged * math.exp(-person.missed_s / _DOUBT_S)
