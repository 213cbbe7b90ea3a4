"""People out of sight: who is remembered, for how long, and who is back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heel.services.tracker.given_boxes.geometry import FloatArray
from heel.services.tracker.given_boxes.looks import LookModel
from heel.services.tracker.given_boxes.memory import Circumstances, claims
from heel.services.tracker.given_boxes.track import Track
from heel.services.tracker.given_boxes.tuning import Tuning

_LOOK_AGAIN_HITS = (8, 24)
"""A newcomer who was not recognised at once is looked at again when there is more to look at."""
_MEMORY_S = 16.0
"""Time without a box after which a person is forgotten, appearance unknown; chosen by hand."""
_KNOWN_MEMORY_S = 120.0
"""The same, where appearance tells who is back: a walk round the block."""
_MOST_REMEMBERED = 64
"""Bound of the people remembered."""
_EDGE = 0.6
"""Distance from the picture's edge that counts as at it [box widths]; chosen by hand."""


class Recall:
    """Keeps lost people and gives newcomers their old ids back."""

    def __init__(
        self, tuning: Tuning, looks: LookModel, image_size: tuple[int, int] | None
    ) -> None:
        """Start with nobody lost; without `image_size` nobody is known to have left."""
        self.lost: list[Track] = []
        self._tuning = tuning
        self._looks = looks
        self._image_size = image_size

    def lose(self, track: Track, pictures: bool) -> None:
        """Remember somebody who is not in sight any more.

        Who went over the edge comes back in any place, where places say nothing: is forgotten
        unless looks can tell.
        """
        track.left = self.at_edge(track)
        if pictures or not track.left:
            self.lost.append(track)

    def forget(self, t_s: float, pictures: bool) -> None:
        """Drop who has been gone for too long, or are too many: the longest gone first."""
        memory_s = _KNOWN_MEMORY_S if pictures else _MEMORY_S
        remembered = [track for track in self.lost if t_s - track.seen_s <= memory_s]
        self.lost = remembered[-_MOST_REMEMBERED:]

    def recognised(
        self, tracks: list[Track], t_s: float, places: bool, pictures: bool
    ) -> list[tuple[Track, Track, float]]:
        """Newcomers in this frame who are somebody known, with the probability.

        Args:
            tracks: everybody near. places: whether the picture's places are those of the world.
            t_s: now. pictures: whether looks are known.

        Returns:
            (newcomer, whom they are, probability); both may be among `tracks`.
        """
        newcomers = [t for t in tracks if t.seen_s == t_s and self._asks(t, pictures)]
        missing = list(self.lost) if places or pictures else []
        if pictures:
            missing += [t for t in tracks if t.confirmed and t.seen_s < t_s]
        if not newcomers or not missing:
            return []
        looks: FloatArray | float = 0.0
        if pictures:
            newest = np.array([track.gallery.newest() for track in newcomers])
            looks = self._looks.compare([track.gallery for track in missing], newest)
        around = Circumstances(t_s, places, self._area_px2() if pictures else None)
        return claims(newcomers, missing, looks, around, self._tuning.trust)

    def _asks(self, track: Track, pictures: bool) -> bool:
        if not track.confirmed:
            return track.ready(self._tuning)
        return pictures and track.hits in _LOOK_AGAIN_HITS

    def _area_px2(self) -> float | None:
        return None if self._image_size is None else float(np.prod(self._image_size))

    def at_edge(self, track: Track) -> bool:
        """Whether the person is where people come and go."""
        return bool(self._near_edges(track).any())

    def at_side(self, track: Track) -> bool:
        """The same for left and right alone: near people reach the lower edge all the time."""
        return bool(self._near_edges(track)[::2].any())

    def _near_edges(self, track: Track) -> NDArray[np.bool_]:
        """Which of left, top, right and lower edge, (4,), somebody is at."""
        if self._image_size is None:
            return np.zeros(4, bool)
        box = track.box()
        inside = np.concatenate([box[:2], np.array(self._image_size) - box[2:]])
        return np.asarray(inside < _EDGE * (box[2] - box[0]))
