"""Which person is meant: the nearest, the one at a point, the one that stands before the robot."""

from __future__ import annotations

import math
from collections.abc import Iterable

from heel.schemas import Track, Tracks
from heel.services.follower.people import Person
from heel.services.geometry.boxes import cover_of_smaller

_TWO_PEOPLE = 0.5
"""Share of the smaller of two boxes that the other covers, from which a click can mean either."""
_FAR_BEHIND = 0.6
"""Height of a box seen inside a higher one, as a share of that, below which it is of somebody
farther away, or shows the little that stands out from behind: not of whom the higher box shows.
Chosen by hand."""

NEWCOMER_S = 1.0
"""Age of a newcomer [s] up to which the tracker may still find that the id is on it; chosen by
hand."""


def seen_well(tracks: Tracks) -> list[Track]:
    """The tracks that are confirmed and seen in this frame."""
    return [track for track in tracks.tracks if track.shown and track.state == "tracked"]


def nearest(tracks: Tracks) -> Track | None:
    """The person that appears largest, of those seen well now."""
    return max(
        seen_well(tracks),
        key=lambda track: (track.box_xyxy[3] - track.box_xyxy[1], -track.id),
        default=None,
    )


def at_point(tracks: Tracks, x_px: float, y_px: float) -> Track | None:
    """The shown person whose box holds the point; of several, the one with the nearest centre."""

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


def companion(chosen: Track, tracks: Tracks) -> Track | None:
    """Another person that the box stands on: the pixels under it then name neither of them.

    Somebody far behind, seen or hidden, leaves the nearer one's box as clear.
    """
    for other in tracks.tracks:
        if other.id == chosen.id or other.state not in ("tracked", "occluded"):
            continue
        if _is_far_behind(other, chosen):
            continue
        behind = other.id in chosen.occluded_by or chosen.id in other.occluded_by
        if behind or cover_of_smaller(chosen.box_xyxy, other.box_xyxy) >= _TWO_PEOPLE:
            return other
    return None


def _is_far_behind(other: Track, chosen: Track) -> bool:
    return _height(other) < _FAR_BEHIND * _height(chosen)


def _height(track: Track) -> float:
    return track.box_xyxy[3] - track.box_xyxy[1]


class Newcomers:
    """Tracks that came forth from the box of another one a moment ago."""

    def __init__(self) -> None:
        self._first: dict[int, tuple[int, tuple[int, ...]]] = {}
        """By id: capture time of the first frame [ns], and the older tracks it began beside."""

    def clear(self) -> None:
        """The ids are those of other people from now on."""
        self._first.clear()

    def observe(self, tracks: Tracks) -> None:
        """Take a frame's tracks."""
        now_ns = tracks.t_capture_ns
        before = {t.id: t for t in tracks.tracks if t.id in self._first}
        self._first = {
            track.id: self._first.get(track.id) or (now_ns, tuple(
                other.id for other in before.values()
                if cover_of_smaller(track.box_xyxy, other.box_xyxy) > 0.0
            ))
            for track in tracks.tracks
        }  # fmt: skip

    def of(self, chosen: Track, tracks: Tracks, shown: bool = True) -> Track | None:
        """A track that came forth from the chosen one's box within the last second.

        Args:
            chosen: in the newest frame.
            tracks: of that frame.
            shown: leave out those that are not shown yet.
        """
        for other in tracks.tracks:
            first_ns, beside = self._first.get(other.id, (0, ()))
            young = tracks.t_capture_ns - first_ns < NEWCOMER_S * 1e9
            near = chosen.id in beside and not _is_far_behind(other, chosen)
            if near and young and (other.shown or not shown):
                return other
        return None


class Imprinting:
    """Waits until one person has stood before the robot for a while."""

    def __init__(self, for_s: float, within_m: float, half_angle_rad: float) -> None:
        self._for_s = for_s
        self._within_m = within_m
        self._half_angle_rad = half_angle_rad
        self._candidate: int | None = None
        self._since_s = 0.0

    @property
    def candidate(self) -> int | None:
        """The person that stands there now."""
        return self._candidate

    def reset(self) -> None:
        """Begin anew."""
        self._candidate = None

    def update(self, people: Iterable[Person], now_s: float) -> int | None:
        """Take a frame's people; returns the one that has stood there long enough.

        Two that stand there at once are one too many: which of them is meant is not guessed.
        """
        before = [
            person.id
            for person in people
            if person.distance_m <= self._within_m
            and abs(person.bearing_rad) <= self._half_angle_rad
        ]
        candidate = before[0] if len(before) == 1 else None
        if candidate != self._candidate:
            self._candidate, self._since_s = candidate, now_s
        if candidate is None or now_s - self._since_s < self._for_s:
            return None
        return candidate
