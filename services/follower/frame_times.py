"""When frames were taken, so that time spent on links counts in their age. No transport."""

from __future__ import annotations

from bisect import bisect_right

from heel.schemas import FrameId, Taken

_KEPT = 1024
"""Frames remembered: 17 s at 60 frames/s, far beyond any age that is driven by."""
SILENT_S = 2.0
"""Without a beacon for so long the camera is taken to have none (any more)."""


class FrameTimes:
    """Learns from the camera's beacon `taken` and bounds the age of frames by it.

    A beacon that is forged, late or missing only ever makes a frame older: the earliest time told
    of a frame counts, a frame whose beacon is missing is as old as the one before, and none is
    younger than what its producers report.

    Args:
        clock: name of the monotonic clock that this process reads.
    """

    def __init__(self, clock: str) -> None:
        self._clock = clock
        self._epoch: int | None = None
        self._seqs: list[int] = []
        self._times_s: list[float] = []
        self._heard_s: float | None = None
        self.same_clock = False
        """Whether the newest beacon was told by this process's clock."""

    def hear(self, taken: Taken, arrived_s: float) -> None:
        """Take a beacon that was judged to be new.

        Args:
            taken: what the camera says.
            arrived_s: monotonic time of its arrival. Where the camera has another clock, the frame
                was taken by then; its way to here is not counted.
        """
        if taken.epoch != self._epoch:
            self._epoch, self._seqs, self._times_s = taken.epoch, [], []
        while self._seqs and self._seqs[-1] >= taken.seq:
            # Told of frames that are yet to come: that was another sender.
            self._seqs.pop()
            self._times_s.pop()
        self._heard_s = arrived_s
        self.same_clock = taken.clock == self._clock
        told_s = taken.monotonic_ns * 1e-9 if self.same_clock else arrived_s
        self._seqs.append(taken.seq)
        self._times_s.append(min(told_s, arrived_s))
        if len(self._seqs) > _KEPT:
            del self._seqs[: _KEPT // 2], self._times_s[: _KEPT // 2]

    def heard(self, now_s: float) -> bool:
        """Whether the camera has a beacon."""
        return self._heard_s is not None and now_s - self._heard_s <= SILENT_S

    def taken_s(self, frame: FrameId, now_s: float) -> tuple[float | None, str]:
        """When a frame was taken at the latest, and what is wrong with the frame.

        Args:
            frame: that a message is about.
            now_s: monotonic time.

        Returns:
            The time, None where no beacon tells; and a reason not to use the frame, or "".
        """
        if frame.epoch != self._epoch:
            if self.heard(now_s):
                return None, f"epoch {frame.epoch} is not the camera's, which is {self._epoch}"
            return None, ""
        at = bisect_right(self._seqs, frame.seq) - 1
        if at < 0:
            return None, f"frame {frame.seq} was taken too long ago to know when"
        return self._times_s[at], ""
