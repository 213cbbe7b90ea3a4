"""A choice on a box that two people may share: it waits until they part, and what was pointed at
decides which of them is meant.

Two are known to share it by a second track in it, or by one that comes forth from it a little
before the choice, or soon after.
"""

from __future__ import annotations

from collections.abc import Sequence

from heel.schemas import Track, Tracks
from heel.schemas.base import BoxXyxy, Point
from heel.services.follower.choosing import NEWCOMER_S, companion
from heel.services.follower.pending import CarriedPoint
from heel.services.geometry.boxes import iou

_PARTED_S = 0.3
"""Each has to have had a box of its own for so long [s]: longer than a detector flickers; chosen by
hand."""
_MOST_S = 10.0
"""Longest wait [s]; two that have not parted by then walk together. Chosen by hand."""
_SAME_IOU = 0.3
"""Overlap of boxes of one person in two frames; chosen by hand: a brisk walk at 5 frames a second
leaves more."""

REOPENED_S = 3.0
"""For so long after a choice somebody may come forth from the box who was meant [s]; chosen by
hand: who walks behind somebody else is hidden for about so long."""


class Click(CarriedPoint):
    """What was pointed at on a box that so far is one person's.

    The point goes along with the box, in shares of its width and height, until somebody begins to
    come forth from it; from then on with the picture, as the box becomes that of one of them.

    Attributes:
        since_s: time of the choice.
    """

    def __init__(self, chosen: Track, point_px: Point, tracks: Tracks, t_s: float) -> None:
        """Begin with the frame of the choice."""
        super().__init__(point_px, tracks)
        self.since_s = t_s
        self._share = _share(chosen, point_px)

    def go_along(self, chosen: Track) -> None:
        """Nobody has come forth by the newest frame."""
        self.place_px = _point(chosen, self._share)


class Provisional:
    """The two that were meant by one choice, until one of them is.

    The point goes along with the box that was pointed at, in shares of its width and height, while
    both are in it. Once they have boxes of their own, the box that holds the point is the one
    meant, and stays it by its place: the tracker may still give the ids the other way round.

    Attributes:
        ids: of the two, the chosen one first.
    """

    def __init__(
        self, chosen: Track, other: Track, point_px: Point | None, t_s: float, parted: bool
    ) -> None:
        """Begin with the frame of the choice.

        Args:
            chosen: whose box was chosen.
            other: the other person that may be in it, or just came forth from it.
            point_px: what was pointed at, in pixels of the frame; None if the id was given, and
                then the id decides.
            t_s: time of that frame.
            parted: whether `other` came forth from the box a moment ago.
        """
        self.ids = (chosen.id, other.id)
        self._since_s = t_s
        self._apart_s: float | None = None
        self._apart_for_s = NEWCOMER_S if parted else _PARTED_S
        self._meant: BoxXyxy | None = None
        self._point_px = point_px
        self._share = (0.5, 0.5) if point_px is None else _share(chosen, point_px)

    @property
    def words(self) -> str:
        """What is said meanwhile."""
        first, second = self.ids
        return f"not sure which of two, {first} and {second}: waiting until they part"

    def decided(self, tracks: Tracks, t_s: float) -> int | None:
        """The id of the one meant; None while that is open, 0 if it cannot be told any more.

        Args:
            tracks: the newest frame.
            t_s: its time.
        """
        if t_s - self._since_s > _MOST_S:
            return 0
        here = [track for track in tracks.tracks if track.id in self.ids and track.shown]
        alone = [t for t in here if t.state == "tracked" and companion(t, tracks) is None]
        # One of them may be far behind the other, who stands alone all the same.
        others = [t for t in here if t.missed_frames == 0 and t not in alone]
        hidden = any(
            t.id == self.ids[0] and t.state == "occluded" and not t.shown for t in tracks.tracks
        )
        if not alone or hidden or any(companion(t, tracks) not in alone for t in others):
            self._together(here)
            return None
        if self._meant is None and len(here) == 2 and all(map(self._holds, here)):
            self._apart_s = None
            return None
        if self._apart_s is None:
            self._apart_s = t_s
        meant = self._pointed_at(alone) if self._meant is None else self._same(alone)
        self._meant = None if meant is None else meant.box_xyxy
        if t_s - self._apart_s < self._apart_for_s:
            return None
        return 0 if meant is None else meant.id

    def _together(self, here: Sequence[Track]) -> None:
        self._apart_s = self._meant = None
        chosen = next((t for t in here if t.id == self.ids[0] and t.missed_frames == 0), None)
        if chosen is not None and self._point_px is not None:
            self._point_px = _point(chosen, self._share)

    def _holds(self, track: Track) -> bool:
        if self._point_px is None:
            return track.id == self.ids[0]
        (x, y), (left, top, right, bottom) = self._point_px, track.box_xyxy
        return left <= x <= right and top <= y <= bottom

    def _pointed_at(self, alone: Sequence[Track]) -> Track | None:
        return next(filter(self._holds, alone), None)

    def _same(self, alone: Sequence[Track]) -> Track | None:
        meant = self._meant or alone[0].box_xyxy
        best = max(alone, key=lambda track: iou(track.box_xyxy, meant))
        return best if iou(best.box_xyxy, meant) >= _SAME_IOU else None


def _share(track: Track, point_px: Point) -> Point:
    """Where a point is in a track's box, in shares of its width and height."""
    left, top, right, bottom = track.box_xyxy
    x, y = point_px
    return (x - left) / max(right - left, 1.0), (y - top) / max(bottom - top, 1.0)


def _point(track: Track, share: Point) -> Point:
    left, top, right, bottom = track.box_xyxy
    return left + share[0] * (right - left), top + share[1] * (bottom - top)
