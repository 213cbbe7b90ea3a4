"""People to the tracks of a message."""

from __future__ import annotations

from collections.abc import Sequence

from heel.schemas import Track
from heel.schemas.tracks import TrackState
from heel.services.geometry import boxes
from heel.services.tracker.blob.clusters import Cluster
from heel.services.tracker.blob.lifecycle import Person


def tracks_of(clusters: Sequence[Cluster]) -> list[Track]:
    """Everybody who is known, by id."""
    tracks = [_track(person, cluster) for cluster in clusters for person in cluster.people]
    return sorted(tracks, key=lambda track: track.id)


def _track(person: Person, cluster: Cluster) -> Track:
    return Track(
        id=person.id,
        state=_state(person, cluster),
        box_xyxy=person.box,
        velocity_pxps=person.filter.velocity_pxps,
        area_px=person.filter.area_px,
        span_px=person.filter.span_px,
        identity_confidence=person.identity_confidence,
        runner_up_confidence=min(person.runner_up_confidence, 1.0 - person.identity_confidence),
        occluded_by=tuple(sorted(other.id for other in _in_front(person, cluster))),
        missed_frames=person.missed_frames,
        shown=person.is_shown,
    )


def _state(person: Person, cluster: Cluster) -> TrackState:
    if not person.confirmed:
        return "new"
    if person.missed_frames:
        return "lost"
    return "occluded" if cluster.is_group else "tracked"


def _in_front(person: Person, cluster: Cluster) -> list[Person]:
    """Members of the group who overlap the person and stand nearer: their feet are lower."""
    return [
        other
        for other in cluster.people
        if (other.box[3], other.id) > (person.box[3], person.id)
        and boxes.intersection(other.box, person.box) > 0
    ]
