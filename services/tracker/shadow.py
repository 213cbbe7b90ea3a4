"""A tracker that stands by: it works on the frames that another one has answered, and compares.

So it knows at every frame whether its people are the other one's. What it cannot keep up with (a
message was lost, it has come later) a snapshot brings back. No transport, no clock.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator

from heel.schemas import Blobs, FrameId, Track, Tracks
from heel.services.runtime.streams import Received
from heel.services.tracker.core import Tracker

_MOST_FRAMES = 64
"""Frames kept that the other one has not answered yet, or that a snapshot may come behind of: two
seconds of an ordinary camera; chosen by hand."""
_SAME_PX = 1.0
"""Difference of boxes from which two trackers are not in the same state: other processors differ in
last digits, other people by far more; chosen by hand."""

_Key = tuple[int, int]


class Shadow:
    """Follows a tracker through its messages.

    Attributes:
        in_step: whether the last frame that both have answered had the same people. Before the
            first one it is not known, and counts as no.
    """

    def __init__(self, tracker: Tracker) -> None:
        """Start with a tracker that knows nothing of the other one yet."""
        self.tracker = tracker
        self.in_step = False
        self._restored = False
        self._done: _Key | None = None
        self._epoch: int | None = None
        self._waiting: OrderedDict[_Key, Received[Blobs]] = OrderedDict()
        self._answers: OrderedDict[_Key, Tracks] = OrderedDict()

    @property
    def wants_state(self) -> bool:
        """Whether only a snapshot of the other one helps."""
        return not self._restored

    @property
    def oldest_unanswered_s(self) -> float | None:
        """When the oldest frame arrived that the other one has not answered; None: all are."""
        newest = next(reversed(self._answers), None)
        for key, received in self._waiting.items():
            if newest is None or newest[0] != key[0] or key > newest:
                return received.arrived_s
        return None

    def hear_blobs(self, received: Received[Blobs]) -> None:
        """A frame, which the other one is about to answer."""
        key = self._key(received.message)
        self._waiting[key] = received
        if len(self._waiting) > _MOST_FRAMES:
            self._waiting.popitem(last=False)
        self._catch_up()

    def hear_tracks(self, tracks: Tracks) -> None:
        """An answer of the other one."""
        self._answers[self._key(tracks)] = tracks
        if len(self._answers) > _MOST_FRAMES:
            self._answers.popitem(last=False)
        self._catch_up()

    def restore(self, state: bytes, frame: FrameId) -> None:
        """Go on from a snapshot of the other one.

        Raises:
            StateError: it is none, or of other settings.
        """
        self.tracker.restore(state)
        self._restored, self._done = True, (frame.epoch, frame.seq)
        self._catch_up()

    def resume(self, frame: FrameId) -> None:
        """Go on from the tracker's own state, which the other one has taken over after a frame."""
        self._restored = self.in_step = True
        self._epoch, self._done = frame.epoch, (frame.epoch, frame.seq)

    def take_over(self) -> Iterator[tuple[Received[Blobs], Tracks]]:
        """The frames that the other one has not answered, and their people.

        Raises:
            HeelError: as `Tracker.update`, for a frame that it refuses; ask again for the next.
        """
        newest = next(reversed(self._answers), None)
        while self._waiting:
            key, received = self._waiting.popitem(last=False)
            if self._is_done(key) or (newest is not None and newest[0] == key[0] and key <= newest):
                continue
            self._done = key
            yield received, self.tracker.update(received.message)
            self.tracker.settle()

    def _key(self, frame: FrameId) -> _Key:
        if frame.epoch != self._epoch:
            # Another start of the camera, with which all trackers begin anew.
            self._epoch = frame.epoch
            self._waiting.clear()
            self._answers.clear()
        return frame.epoch, frame.seq

    def _catch_up(self) -> None:
        """Work on what the other one has worked on, in its order."""
        newest = next(reversed(self._answers), None)
        while self._restored and newest is not None and self._waiting:
            key, received = next(iter(self._waiting.items()))
            if self._is_done(key):
                self._waiting.popitem(last=False)
                continue
            if key > newest:
                return
            missed = next(iter(one for one in self._answers if not self._is_done(one)), None)
            if missed is not None and missed < key:
                # The other one has worked on a frame that never came here.
                self._lose_step()
                return
            self._waiting.popitem(last=False)
            told = self._answers.pop(key, None) if key != newest else self._answers[key]
            if told is None:
                continue  # It never came to the other one.
            self._done = key
            found = self.tracker.update(received.message)
            self.tracker.settle()
            self.in_step = _same_people(found.tracks, told.tracks)
            if not self.in_step:
                self._lose_step()
                return

    def _lose_step(self) -> None:
        self.in_step = self._restored = False

    def _is_done(self, key: _Key) -> bool:
        return self._done is not None and self._done[0] == key[0] and key <= self._done


def _same_people(own: tuple[Track, ...], told: tuple[Track, ...]) -> bool:
    if [track.id for track in own] != [track.id for track in told]:
        return False
    return all(
        abs(mine - theirs) <= _SAME_PX
        for one, other in zip(own, told, strict=True)
        for mine, theirs in zip(one.box_xyxy, other.box_xyxy, strict=True)
    )
