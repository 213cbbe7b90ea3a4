"""Which frames of a lossless run are complete, in order."""

from __future__ import annotations


class FrameJoin:
    """Collects the parts of each frame; frames are released in order, once all parts are there."""

    def __init__(self, parts: frozenset[str]) -> None:
        self._parts = parts
        self._have: dict[int, set[str]] = {}
        self._next = 0

    def add(self, part: str, seq: int) -> int | None:
        """Note a part; returns the newest frame that is complete with all before it, if new."""
        if seq >= self._next:
            self._have.setdefault(seq, set()).add(part)
        newest = None
        while self._have.get(self._next, set()) >= self._parts:
            del self._have[self._next]
            newest = self._next
            self._next += 1
        return newest
