"""Whom to look at more closely in this frame: taking turns, so that nobody is forgotten."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from heel.schemas.base import BoxXyxy
from heel.services.detector.neural.views import View, Views

_NEWCOMER_TURN = 2
"""Somebody without an identity yet waits as long as one who was looked at so many frames ago."""
_SEARCH_TURN = 8
"""Where nobody is expected is looked at every so many frames, and in every one as long as nobody is
expected anywhere."""


@dataclass(frozen=True, slots=True)
class Expected:
    """Somebody who is likely to be in this frame.

    Attributes:
        box_xyxy: where, frame pixels.
        track_id: who, None for somebody who is not known yet.
    """

    box_xyxy: BoxXyxy
    track_id: int | None


class Attention:
    """Chooses the views of a frame."""

    def __init__(self, views: Views) -> None:
        """Start with nobody looked at."""
        self._views = views
        self._looked: dict[int, int] = {}
        self._searched, self._tile, self._turn = 0, 0, 0

    def next_views(self, expected: Sequence[Expected], most: int) -> list[View]:
        """The views of those who have waited longest, and now and then a tile of the frame.

        None where a closer look at anybody would show no more than the whole frame does.

        Args:
            expected: who is likely to be in this frame.
            most: number of views.
        """
        views: list[View] = []
        while len(views) < most and (view := self._next_view(expected, views)) is not None:
            views.append(view)
        return views

    def _next_view(self, expected: Sequence[Expected], chosen: Sequence[View]) -> View | None:
        self._turn += not chosen
        known = {person.track_id for person in expected}
        self._looked = {one: turn for one, turn in self._looked.items() if one in known}
        waiting = [
            (self._last_look(person), view)
            for person in expected
            if not any(view.holds(person.box_xyxy) for view in chosen)
            and (view := self._views.around(person.box_xyxy)) is not None
        ]
        tiles = self._views.tiles
        if tiles and (not expected or self._turn - self._searched >= _SEARCH_TURN):
            return self._search(expected)
        if not waiting:
            return None
        view = min(waiting, key=lambda entry: entry[0])[1]
        self._note(view, expected)
        return view

    def _search(self, expected: Sequence[Expected]) -> View | None:
        tiles = self._views.tiles
        if self._searched == self._turn:
            return None
        self._searched = self._turn
        self._tile = (self._tile + 1) % len(tiles)
        self._note(tiles[self._tile], expected)
        return tiles[self._tile]

    def _last_look(self, person: Expected) -> int:
        if person.track_id is None:
            return self._turn - _NEWCOMER_TURN
        return self._looked.get(person.track_id, 0)

    def _note(self, view: View, expected: Sequence[Expected]) -> None:
        for person in expected:
            if person.track_id is not None and view.holds(person.box_xyxy):
                self._looked[person.track_id] = self._turn
