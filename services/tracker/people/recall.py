"""Tracks out of sight: how long they are remembered, and their re-identification."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from heel.services.tracker.people.geometry import FloatArray
from heel.services.tracker.people.looks import Gallery, LookModel
from heel.services.tracker.people.memory import Circumstances, Claim, claims
from heel.services.tracker.people.track import Track
from heel.services.tracker.trace import Event, Trace

_LOOK_AGAIN_HITS = (8, 24)
"""Boxes after which a new track that was not re-identified at once is compared again, with a larger
gallery; chosen by hand."""
_MEMORY_S = 16.0
"""Time without a box after which a track is forgotten [s], appearance unknown; chosen by hand."""
_KNOWN_MEMORY_S = 120.0
"""The same [s], where appearance identifies a return: a walk round the block; chosen by hand."""
_MOST_REMEMBERED = 64
"""Most tracks out of sight that are remembered; chosen by hand."""
_EDGE = 0.6
"""Distance from the picture's edge that counts as at it [box widths]; chosen by hand."""


class Recall:
    """Keeps lost tracks and finds new tracks that are their returns."""

    def __init__(
        self, looks: LookModel, image_size: tuple[int, int] | None, trust: float,
        trace: Trace | None = None,
    ) -> None:  # fmt: skip
        """Start without lost tracks.

        Args:
            looks: compares appearance. image_size: without it no track is known to have left.
            trust: least probability of a return that gives the old id back.
            trace: takes what is decided.
        """
        self.lost: list[Track] = []
        self._trust = trust
        self._looks = looks
        self._image_size = image_size
        self._trace = trace or Trace()

    def lose(self, track: Track, pictures: bool) -> None:
        """Remember a track that is out of sight.

        A person that left over the edge comes back at any place, so that the track is forgotten
        unless appearance can identify it.
        """
        track.left = self.at_edge(track)
        if pictures or not track.left:
            self.lost.append(track)
        else:
            self._note_forgotten([track])

    def forget(self, t_s: float, pictures: bool) -> None:
        """Drop tracks out of sight for too long, and of too many those lost first."""
        memory_s = _KNOWN_MEMORY_S if pictures else _MEMORY_S
        remembered = [track for track in self.lost if t_s - track.seen_s <= memory_s]
        self.lost, before = remembered[-_MOST_REMEMBERED:], self.lost
        if len(self.lost) < len(before):
            kept = {id(track) for track in self.lost}
            self._note_forgotten([track for track in before if id(track) not in kept])

    def _note_forgotten(self, tracks: list[Track]) -> None:
        for track in tracks:
            self._trace.note(Event("forgotten", id=track.track_id))

    def recognised(
        self, ready: Sequence[Track], tracks: Sequence[Track], t_s: float, places: bool,
        pictures: bool,
    ) -> list[Claim]:  # fmt: skip
        """Which known person each new track of this frame most probably is.

        Where descriptors are known, a track that has not been seen alone waits for its first one:
        places alone would give the id of whoever was last seen there, and after two stood in one
        box that may be either.

        Args:
            ready: new tracks that are about to be confirmed. tracks: all in sight.
            t_s: now. places: whether places in the picture are places in the world.
            pictures: whether descriptors are known.

        Returns:
            Claims, those that do not hold too; both tracks of one may be among `tracks`.
        """
        first = {id(track) for track in ready}
        newcomers = [
            track
            for track in tracks
            if id(track) in first or (pictures and track.seen_s == t_s and _asks_again(track))
        ]
        if pictures:
            newcomers = [track for track in newcomers if track.gallery.looks]
            for track in newcomers:
                track.compared = True
        missing = list(self.lost) if places or pictures else []
        if pictures:
            missing += [t for t in tracks if t.confirmed and t.seen_s < t_s]
        if not newcomers or not missing:
            return []
        looks: FloatArray | float = 0.0
        if pictures:
            newest = np.array([track.gallery.newest() for track in newcomers])
            looks = self._looks.compare([track.gallery for track in missing], newest)
            looks -= self._own(newcomers, newest)
        around = Circumstances(t_s, places, self._area_px2() if pictures else None)
        return claims(newcomers, missing, looks, around, self._trust)

    def _own(self, newcomers: Sequence[Track], newest: FloatArray) -> FloatArray:
        """Log odds (N,) that descriptors (N, D) are of the people that newcomers were found to be.

        Looks speak for another one only as far as they fit that one better: else a second identity
        of the same person, as of a box that was off once, would take over in the end.
        """
        known = [track.recalled or Gallery() for track in newcomers]
        return np.maximum(np.diagonal(self._looks.compare(known, newest)), 0.0)

    def _area_px2(self) -> float | None:
        return None if self._image_size is None else float(np.prod(self._image_size))

    def at_edge(self, track: Track) -> bool:
        """Whether the box is at an edge of the picture, where people come and go."""
        return bool(self._near_edges(track).any())

    def at_side(self, track: Track) -> bool:
        """The same for left and right alone: near people reach the lower edge all the time."""
        return bool(self._near_edges(track)[::2].any())

    def _near_edges(self, track: Track) -> NDArray[np.bool_]:
        """At which of left, top, right and lower edge the box is, (4,)."""
        if self._image_size is None:
            return np.zeros(4, bool)
        box = track.box()
        inside = np.concatenate([box[:2], np.array(self._image_size) - box[2:]])
        return np.asarray(inside < _EDGE * (box[2] - box[0]))


def _asks_again(track: Track) -> bool:
    # Not much later: a user may have chosen the id that would be replaced.
    waited = not track.compared and track.hits <= _LOOK_AGAIN_HITS[-1]
    return track.confirmed and (waited or track.hits in _LOOK_AGAIN_HITS)
