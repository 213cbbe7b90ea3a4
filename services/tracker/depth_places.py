"""How far tracked people are by a depth picture: distance, bearing and sigmas in the tracks."""

from __future__ import annotations

from heel.schemas import Track, Tracks
from heel.services.geometry.camera import Pinhole
from heel.services.geometry.depth import Depth, body_place


def with_depth(tracks: Tracks, depth_mm: Depth, camera: Pinhole) -> Tracks:
    """The same tracks; those that the depth picture shows have a measured place.

    Args:
        tracks: of the frame that the depth picture is aligned to.
        depth_mm: (H, W) uint16, 0 for no measurement.
        camera: with pictures of the tracks' size; `GroundCamera` where its mounting is known.
    """
    people = tuple(_placed(track, tracks, depth_mm, camera) for track in tracks.tracks)
    return tracks.model_copy(update={"tracks": people})


def _placed(track: Track, tracks: Tracks, depth_mm: Depth, camera: Pinhole) -> Track:
    # The box of a person who is not measured on its own may be on somebody else.
    if track.state != "tracked" or track.distance_m is not None:
        return track
    hidden_by = [
        other.box_xyxy for other in tracks.tracks
        if other.id != track.id and other.missed_frames == 0
        and other.box_xyxy[3] > track.box_xyxy[3]
    ]  # fmt: skip
    place = body_place(depth_mm, track.box_xyxy, camera, hidden_by)
    if place is None:
        return track
    update: dict[str, float] = {
        "distance_m": place.distance_m, "distance_sigma_m": place.distance_sigma_m,
    }  # fmt: skip
    if place.bearing_rad is not None:
        update["bearing_rad"] = place.bearing_rad
        update["bearing_sigma_rad"] = place.bearing_sigma_rad
    return track.model_copy(update=update)
