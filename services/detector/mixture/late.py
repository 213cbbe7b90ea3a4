"""Frames are learned late, when the tracks of that very frame are here.

Protection is then exact whatever the lag. Everybody confirmed is protected, seen or not: somebody
who is `occluded` or `lost` may well stand there unseen, and would be learned just then. What this
keeps for ever by mistake is the ghosts' to find.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from heel.schemas import FrameId, Tracks
from heel.services.detector.free_mask import free_mask, shift_s
from heel.services.detector.geometry import WorkSize
from heel.services.detector.regions import Indices

MAX_SHIFT_S = 1.0
"""Tracks speak for frames at most this far from their own: beyond it a position is a guess."""

_SPARE_FRAMES = 6


@dataclass(frozen=True, slots=True)
class LateFrame:
    """A frame that is due.

    Attributes:
        image: (H, W, 3) uint8.
        free: (H, W) uint8, 0 under protected people, else 255.
        dt_s: seconds since the frame that was due before.
        protected_seq: frame whose tracks protected it, None without.
    """

    image: NDArray[np.uint8]
    free: NDArray[np.uint8]
    dt_s: float
    protected_seq: int | None


@dataclass(frozen=True, slots=True)
class _Waiting:
    frame: FrameId
    image: NDArray[np.uint8]
    forgotten: list[Indices] = field(default_factory=list)


class LateFrames:
    """Frames that wait for their tracks, at most `lag_frames` and a few more.

    A frame that was never tracked (a live stream skips some) takes the tracks of the nearest later
    one. When the queue is full the oldest goes with the last tracks there were.
    """

    def __init__(self, size: WorkSize, lag_frames: int, start_ns: int) -> None:
        self._size = size
        self._bound = lag_frames + _SPARE_FRAMES
        self._waiting: deque[_Waiting] = deque()
        self._tracks: Tracks | None = None
        self._last_ns = start_ns

    def add(self, frame: FrameId, image: NDArray[np.uint8]) -> None:
        """Let a frame wait; the image is kept and must not be written to afterwards."""
        self._waiting.append(_Waiting(frame, image))

    def forget(self, index: Indices) -> None:
        """Let no waiting frame teach these pixels: the model has started over there since."""
        if index.size:
            for waiting in self._waiting:
                waiting.forgotten.append(index)

    def due(self, tracks: Tracks | None) -> Iterator[LateFrame]:
        """The frames to be learned now, oldest first.

        Args:
            tracks: of an earlier frame of the same size; None when there are none.
        """
        if tracks is not None and (self._tracks is None or tracks.seq > self._tracks.seq):
            self._tracks = tracks
        done = -1 if self._tracks is None else self._tracks.seq
        while self._waiting and (
            self._waiting[0].frame.seq <= done or len(self._waiting) > self._bound
        ):
            yield self._release(self._waiting.popleft())

    def _release(self, waiting: _Waiting) -> LateFrame:
        frame, people = waiting.frame, self._tracks
        if people is not None and abs(shift_s(people, frame)) > MAX_SHIFT_S:
            people = None
        free = free_mask(people, frame, self._size)
        for index in waiting.forgotten:
            free.reshape(-1)[index] = 0
        dt_s = max((frame.t_capture_ns - self._last_ns) * 1e-9, 1e-3)
        self._last_ns = frame.t_capture_ns
        return LateFrame(waiting.image, free, dt_s, None if people is None else people.seq)
