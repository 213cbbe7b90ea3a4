"""People to the `Tracks` message."""

from __future__ import annotations

from collections.abc import Sequence

from schemas import Blobs, FrameId, Track, Tracks
from schemas.tracks import TrackState
from services.tracker import boxes
from services.tracker.clusters import Cluster
from services.tracker.lifecycle import Person


def tracks_message(blobs: Blobs, clusters: Sequence[Cluster]) -> Tracks:
    """Everybody who is known, by id; `occlusion` while any people share a blob."""
    tracks = [_track(person, cluster) for cluster in clusters for person in cluster.people]
    return Tracks(
        **blobs.model_dump(include=set(FrameId.model_fields)),
        width=blobs.width,
        height=blobs.height,
        source_width=blobs.source_width,
        source_height=blobs.source_height,
        tracks=tuple(sorted(tracks, key=lambda track: track.id)),
        occlusion=any(cluster.is_group for cluster in clusters),
    )


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
