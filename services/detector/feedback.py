"""The tracks that a frame is protected with: a fixed number of frames old, whoever is faster."""

from __future__ import annotations

from collections import OrderedDict

from heel.schemas import FrameId, Tracks

_KEPT = 64


class FeedbackBuffer:
    """Recent tracks by frame, of the newest epoch only."""

    def __init__(self, lag_frames: int) -> None:
        self._lag = lag_frames
        self._epoch: int | None = None
        self._tracks: OrderedDict[int, Tracks] = OrderedDict()

    def add(self, tracks: Tracks) -> None:
        """Keep the tracks of one frame."""
        if tracks.epoch != self._epoch:
            self._epoch = tracks.epoch
            self._tracks.clear()
        self._tracks[tracks.seq] = tracks
        while len(self._tracks) > _KEPT:
            self._tracks.popitem(last=False)

    def exact(self, frame: FrameId) -> Tracks | None:
        """The tracks of exactly `lag` frames before, if they are here."""
        if frame.epoch != self._epoch:
            return None
        return self._tracks.get(frame.seq - self._lag)

    def newest(self, frame: FrameId) -> Tracks | None:
        """The newest tracks at least `lag` frames old: all that a live stream can promise."""
        if frame.epoch != self._epoch:
            return None
        seqs = [seq for seq in self._tracks if seq <= frame.seq - self._lag]
        return self._tracks[max(seqs)] if seqs else None
