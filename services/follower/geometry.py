"""Where a person stands relative to the camera, from the box alone (pinhole camera)."""

from __future__ import annotations

import math

from schemas import Track, Tracks

_BORDER_PX = 2.0


def focal_length_px(width_px: int, horizontal_fov_rad: float) -> float:
    """Focal length of a pinhole camera with square pixels."""
    return width_px / (2.0 * math.tan(horizontal_fov_rad / 2.0))


def bearing_rad(track: Track, width_px: int, horizontal_fov_rad: float) -> float:
    """Angle from the optical axis to the box centre, left is positive."""
    left, _, right, _ = track.box_xyxy
    offset_px = width_px / 2.0 - (left + right) / 2.0
    return math.atan2(offset_px, focal_length_px(width_px, horizontal_fov_rad))


def distance_m(
    track: Track, size_px: tuple[int, int], horizontal_fov_rad: float, person_height_m: float
) -> float:
    """Apparent distance: a person of known height is `focal * height / box height` away.

    A box that is cut by a border is shorter than the person and so looks farther away. One that
    fills the picture from top to bottom may be anywhere up to touching: its distance is 0.
    """
    if track.box_xyxy[1] <= _BORDER_PX and track.box_xyxy[3] >= size_px[1] - _BORDER_PX:
        return 0.0
    height_px = max(1.0, track.box_xyxy[3] - track.box_xyxy[1])
    return focal_length_px(size_px[0], horizontal_fov_rad) * person_height_m / height_px


def nearest(tracks: Tracks) -> Track | None:
    """The person who appears largest, among those who are seen well now."""
    seen = [track for track in tracks.tracks if track.shown and track.state == "tracked"]
    return max(seen, key=lambda t: (t.box_xyxy[3] - t.box_xyxy[1], -t.id), default=None)


def at_point(tracks: Tracks, x_px: float, y_px: float) -> Track | None:
    """The shown person whose box holds the point; of several, the one whose centre is nearest."""

    def off_centre(track: Track) -> float:
        left, top, right, bottom = track.box_xyxy
        return math.hypot((left + right) / 2 - x_px, (top + bottom) / 2 - y_px)

    hit = [
        track
        for track in tracks.tracks
        if track.shown
        and track.box_xyxy[0] <= x_px <= track.box_xyxy[2]
        and track.box_xyxy[1] <= y_px <= track.box_xyxy[3]
    ]
    return min(hit, key=off_centre, default=None)
