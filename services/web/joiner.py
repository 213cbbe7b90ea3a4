"""Bringing image and tracks of the very same frame together.

Tracks come later than their image, because a detector and a tracker work on it first, but over
a slow link a small tracks message may also overtake its image. Both are held, in bounded
numbers, until the partner of the same (stream, epoch, seq) is there.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

from heel.schemas import FrameId, Header, Tracks

_FrameKey = tuple[str, int, int]


@dataclass(frozen=True, slots=True)
class HeldImage:
    """An image as it came, not decoded."""

    header: Header
    payload: bytes
    arrived_s: float
    """Monotonic seconds."""


@dataclass(frozen=True, slots=True)
class Joined:
    """One frame to show; without tracks if they did not come in time."""

    image: HeldImage
    tracks: Tracks | None
    tracker: str | None
    """The producer that gave out the ids."""


class FrameJoiner:
    """Pairs images with tracks and gives frames out in order, never going back.

    Args:
        deadline_s: an image that waited so long is given out without tracks.
        max_images: images held at most; the oldest then goes out without tracks.
        max_bytes: bytes of images held at most; likewise.
        max_tracks: tracks messages held at most; the oldest are forgotten.
    """

    def __init__(
        self, deadline_s: float, max_images: int, max_bytes: int, max_tracks: int = 64
    ) -> None:
        self._deadline_s = deadline_s
        self._max_images = max_images
        self._max_bytes = max_bytes
        self._max_tracks = max_tracks
        self._images: OrderedDict[_FrameKey, HeldImage] = OrderedDict()
        self._bytes = 0
        self._tracks: OrderedDict[_FrameKey, tuple[Tracks, str]] = OrderedDict()
        self._shown: _FrameKey | None = None
        self.passed_over = 0
        """Images that were not shown because a later frame was complete before them."""

    def add_image(self, image: HeldImage) -> list[Joined]:
        """Take an image; returns the frames that can be shown now."""
        key = _key(image.header)
        newest = next(reversed(self._images), key)
        if self._is_past(key) or (newest[:2] == key[:2] and newest[2] > key[2]):
            self.passed_over += 1
            return []
        if newest[:2] != key[:2]:
            self.clear()
        self._images[key] = image
        self._bytes += len(image.payload)
        if key in self._tracks:
            return [self._release(key)]
        overfull = []
        while len(self._images) > self._max_images or self._bytes > self._max_bytes:
            overfull.append(self._release(next(iter(self._images))))
        return overfull

    def add_tracks(self, tracks: Tracks, tracker: str) -> list[Joined]:
        """Take a frame's tracks and their producer; returns the frames that can be shown now."""
        key = _key(tracks)
        if self._is_past(key):
            return []
        self._tracks[key] = (tracks, tracker)
        if key in self._images:
            return [self._release(key)]
        while len(self._tracks) > self._max_tracks:
            self._tracks.popitem(last=False)
        return []

    def due(self, now_s: float) -> list[Joined]:
        """Frames that no tracks came for within the deadline."""
        late: list[Joined] = []
        while self._images:
            key, image = next(iter(self._images.items()))
            if now_s < image.arrived_s + self._deadline_s:
                break
            late.append(self._release(key))
        return late

    def next_due_s(self) -> float | None:
        """When `due` has something to give, at the latest; None while nothing waits."""
        if not self._images:
            return None
        return next(iter(self._images.values())).arrived_s + self._deadline_s

    def clear(self) -> None:
        """Forget the images held."""
        self.passed_over += len(self._images)
        self._images.clear()
        self._bytes = 0

    @property
    def waiting(self) -> int:
        """Images held."""
        return len(self._images)

    def _release(self, key: _FrameKey) -> Joined:
        """Take a frame out, with everything before it: shown out of order it would jump back."""
        while True:
            held, image = self._images.popitem(last=False)
            self._bytes -= len(image.payload)
            if held == key:
                break
            self.passed_over += 1
        self._shown = key
        tracks, tracker = self._tracks.pop(key, (None, None))
        for past in [k for k in self._tracks if k[:2] == key[:2] and k[2] < key[2]]:
            del self._tracks[past]
        return Joined(image, tracks, tracker)

    def _is_past(self, key: _FrameKey) -> bool:
        shown = self._shown
        return shown is not None and shown[:2] == key[:2] and key[2] <= shown[2]


def _key(frame: FrameId) -> _FrameKey:
    return frame.stream, frame.epoch, frame.seq
