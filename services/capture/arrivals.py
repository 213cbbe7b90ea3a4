"""When a picture of a live stream was taken, judged by when it arrived.

Pictures that waited in the buffer of a camera, a link or a socket arrive late and in a heap. The
first to arrive after them is no newer for having been read just now.
"""

from __future__ import annotations

import math
from collections import deque

_DRIFT = 5e-4
"""How much faster than ours a camera's clock may run: quartz is good to 1e-4."""
_CLOCK_LEAP_S = 10.0
"""Time stamps that run so far ahead of the arrivals started anew."""
_JOIN_S = 1.0
"""So long may a server send what it had kept before the newest picture is due."""
_MEMORY_FRAMES = 32
"""Latest pictures that the usual period is told from; chosen by hand."""
_FEWEST_FRAMES = 3
"""Pictures before which no period is told; chosen by hand."""
_GAP_PERIODS = 3.0
"""Usual periods of a pause that may be a stall; chosen by hand."""
_SHORTEST_GAP_S = 0.1
"""A pause longer than both is a stall, a shorter one is jitter; chosen by hand."""
_WAITED = 0.9
"""A picture that came so many periods after the last was waited for, not taken from a heap."""
_CAUGHT_UP_FRAMES = 4
"""Pictures in a row that were waited for, after which no heap is left; chosen by hand."""
_SLOW_FRAMES = 3
"""As many long pauses in a row are a lower rate."""


class StampedArrivals:
    """For streams with a clock of their own: RTP, MPEG-TS and most containers.

    The picture that arrived earliest by its time stamp was not held up; every other is as late as
    it arrived later than that. The earliest one is forgotten at the rate by which clocks drift.
    """

    def __init__(self) -> None:
        self._least_s = math.inf
        self._first_s = self._last_s = self._stamp_s = math.nan
        self.joined = False
        """Whether the newest picture is reached: before, nothing tells how old a picture is."""

    def late_s(self, arrived_s: float, stamp_s: float) -> float:
        """Seconds that a picture was held up, at least.

        Args:
            arrived_s: when it arrived, on a monotonic clock.
            stamp_s: its time stamp in the order of display, on the stream's clock.
        """
        step_s, passed_s = stamp_s - self._stamp_s, arrived_s - self._last_s
        self._stamp_s, self._last_s = stamp_s, arrived_s
        if math.isnan(step_s):
            self._first_s = arrived_s
        elif step_s < 0.0 or step_s > passed_s + _CLOCK_LEAP_S:
            self._least_s = math.inf
        else:
            self._least_s += _DRIFT * passed_s
            joined = passed_s >= 0.5 * step_s or arrived_s - self._first_s > _JOIN_S
            self.joined = self.joined or joined
        offset_s = arrived_s - stamp_s
        self._least_s = min(self._least_s, offset_s)
        return offset_s - self._least_s


class CountedArrivals:
    """For streams without a clock, such as MJPEG over HTTP: every picture counts as one period.

    After a stall the first picture may have waited all through it, and each that follows faster
    than the rate has caught up a little. Pictures that come at the rate again, several in a row,
    are new: there is nothing left to take them from.
    """

    def __init__(self) -> None:
        self._periods_s: deque[float] = deque(maxlen=_MEMORY_FRAMES)
        self._last_s: float | None = None
        self._behind_s = 0.0
        self._waited = self._gaps = 0

    def late_s(self, arrived_s: float) -> float:
        """Seconds that a picture was held up, at most; one arrived at `arrived_s`, monotonic."""
        if self._last_s is None:
            self._last_s = arrived_s
            return 0.0
        passed_s, self._last_s = arrived_s - self._last_s, arrived_s
        if len(self._periods_s) < _FEWEST_FRAMES:
            self._periods_s.append(passed_s)
            return 0.0
        period_s = sum(self._periods_s) / len(self._periods_s)
        if passed_s > max(_GAP_PERIODS * period_s, _SHORTEST_GAP_S):
            self._after_gap(passed_s, period_s)
        else:
            self._after_wait(passed_s, period_s)
        return self._behind_s

    def _after_gap(self, passed_s: float, period_s: float) -> None:
        self._gaps += 1
        self._waited = 0
        self._behind_s += passed_s - period_s
        if self._gaps >= _SLOW_FRAMES:
            self._gaps, self._behind_s = 0, 0.0
            self._periods_s.clear()
            self._periods_s.extend([passed_s] * _FEWEST_FRAMES)

    def _after_wait(self, passed_s: float, period_s: float) -> None:
        self._gaps = 0
        if self._behind_s == 0.0:
            self._periods_s.append(passed_s)
            return
        self._waited = self._waited + 1 if passed_s >= _WAITED * period_s else 0
        self._behind_s = max(0.0, self._behind_s - max(0.0, period_s - passed_s))
        if self._waited >= _CAUGHT_UP_FRAMES:
            self._behind_s = 0.0
        if self._behind_s < 1e-3:
            self._behind_s, self._waited = 0.0, 0
