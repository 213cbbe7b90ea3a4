"""What the paper's tracker knows of its people, as reports."""

from __future__ import annotations

from collections.abc import Sequence

from heel.services.geometry import boxes
from heel.services.tracker.paper.clusters import Cluster
from heel.services.tracker.paper.lifecycle import Person
from heel.services.tracker.report import Report

_HIDES = 0.5
"""Share of a missed person's box under that of a nearer one above which that one is an occluder;
chosen by hand."""


def reports_of(clusters: Sequence[Cluster]) -> list[Report]:
    """Reports of all known people."""
    everybody = [person for cluster in clusters for person in cluster.people]
    return [
        _report(person, cluster, everybody) for cluster in clusters for person in cluster.people
    ]


def _report(person: Person, cluster: Cluster, everybody: Sequence[Person]) -> Report:
    if person.missed_frames:
        least, others = _HIDES * boxes.area(person.box), everybody
    else:
        least, others = 0.0, cluster.people
    return Report(
        id=person.id,
        box_xyxy=person.box,
        velocity_pxps=person.filter.velocity_pxps,
        confirmed=person.confirmed,
        alone=not person.missed_frames and not cluster.is_group,
        missed_frames=person.missed_frames,
        in_front=tuple(
            other.id
            for other in others
            if other.confirmed
            and (other.box[3], other.id) > (person.box[3], person.id)
            and boxes.intersection(other.box, person.box) > least
        ),
        identity_confidence=person.identity_confidence,
        runner_up_confidence=person.runner_up_confidence,
        shown=person.is_shown,
    )
