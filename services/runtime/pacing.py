"""When the next frame of a recording is due, so that it plays at its own rate."""

from __future__ import annotations

LONGEST_GAP_S = 0.5
"""A machine too slow for a recording shows it slowly rather than not at all; chosen by hand."""


class Pacer:
    """Deadlines on a grid of `1 / fps` seconds that starts with the first frame.

    Every deadline is computed from the start, so that rounding and late wake-ups do not add up. A
    player that falls behind does not burst: `frames_behind` says how many frames to leave out. One
    that stays behind for half a second starts anew with the frame at hand: leaving out takes time
    too, and a busy machine left out everything (387 frames of 413).

    Example:
        pacer = Pacer(25.0)
        while frame := source.read():
            skipped += skip(source, pacer.frames_behind(frame.index, now_s()))
            wait(pacer.delay_s(frame.index, now_s()))
    """

    def __init__(self, fps: float) -> None:
        self._fps = fps
        self._start_s: float | None = None
        self._shown_s: float | None = None

    def due_s(self, index: float, now_s: float) -> float:
        """When frame `index` is due, on the clock of `now_s`; the first one asked for is due now.

        Args:
            index: position of the frame on the source's timeline, frame periods from its start.
            now_s: a monotonic clock, seconds.
        """
        if self._start_s is None:
            self._start_s = now_s - index / self._fps
        return self._start_s + index / self._fps

    def delay_s(self, index: float, now_s: float) -> float:
        """Seconds to wait before showing frame `index`; 0 when it is late."""
        return max(0.0, self.due_s(index, now_s) - now_s)

    def frames_behind(self, index: float, now_s: float) -> int:
        """How many frames from `index` on should be left out because a later one is due already.

        The frame shown in their place is at most one frame period late, unless nothing has been
        shown for half a second.
        """
        starved = self._shown_s is not None and now_s - self._shown_s > LONGEST_GAP_S
        if starved and now_s > self.due_s(index, now_s):
            self.resume(index, now_s)
        # A nanosecond of slack: a wait that ends on its deadline must not count as late.
        lateness_s = now_s - self.due_s(index, now_s) + 1e-9
        behind = max(0, int(lateness_s * self._fps))
        if behind == 0:
            self._shown_s = max(now_s, self.due_s(index, now_s))
        return behind

    def resume(self, index: float, now_s: float) -> None:
        """Start the grid anew with frame `index` due now, after a pause that is not to be seen."""
        self._start_s = now_s - index / self._fps
