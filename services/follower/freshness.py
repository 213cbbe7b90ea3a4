"""Whether tracks come young enough, and often enough, to move by."""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from statistics import mean, median

_FRAMES = 12
"""So many are looked back at for the rate, at least three: half a second of an ordinary camera."""
_LEAST_FRAMES = 3
"""Frames: two intervals are the fewest that a rate can be told from."""
_CALM_S = 5.0
"""Staleness that comes again within this is the same trouble; chosen by hand."""
_LONGEST_WAIT_S = 1.0
"""A machine that is late once a second still lets the robot drive in between."""
_TOLD_ANEW_S = 2.0
"""The measured rate is never twice the same: a reason that changes with every frame is noise."""
_SHORTEST_S = 1 / 30
"""What comes so late that more than 30 frames/s would be needed is late, not rare."""
_SILENT_INTERVALS = 3.0
"""After so many intervals without a frame it is not the rate: nothing is sent any more."""


class Freshness:
    """Says when nothing may rest on the tracks, and stays with it until they come steadily again.

    A camera that gives too few frames makes every one of them stale before the next: a robot that
    went on with each would stutter. So tracks count again only after they have been fresh for
    longer than one frame can be, and twice as long every time it happens again.

    Args:
        max_age_s: older tracks are stale.
        confirm_s: for how long they have to be fresh again at least.
    """

    def __init__(self, max_age_s: float, confirm_s: float) -> None:
        self._max_age_s = max_age_s
        self._least_wait_s = self._wait_s = max(max_age_s, confirm_s)
        self._stale_s = self._told_s = -math.inf
        self._frames: deque[tuple[float, float]] = deque(maxlen=_FRAMES)
        self._stale = False
        self.cause: str | None = None
        """What of the camera makes tracks stale all the time, if that is why they are."""

    def frame(self, t_s: float, age_s: float) -> None:
        """Note a frame that has come.

        Args:
            t_s: when it was taken.
            age_s: how old it was on its arrival.
        """
        self._frames.append((t_s, age_s))

    def restart(self) -> None:
        """Another camera or tracker: what was measured of the old one means nothing."""
        self._frames.clear()

    def judge(self, now_s: float, age_s: float) -> str | None:
        """Why nothing may rest on the tracks now; None if they are fresh.

        Args:
            now_s: the present.
            age_s: of the newest tracks; not a number counts as stale.
        """
        if age_s <= self._max_age_s:
            if now_s - self._stale_s >= self._wait_s:
                self._stale, self.cause = False, None
            return self._reason()
        if not self._stale:
            again = now_s - self._stale_s < _CALM_S
            longer_s = max(self._least_wait_s, min(2.0 * self._wait_s, _LONGEST_WAIT_S))
            self._wait_s = longer_s if again else self._least_wait_s
        if not self._stale or now_s - self._told_s >= _TOLD_ANEW_S:
            self.cause, self._told_s = self._measured(age_s), now_s
        self._stale, self._stale_s = True, now_s
        return self._reason()

    def _reason(self) -> str | None:
        if not self._stale:
            return None
        plain = f"tracks are older than {self._max_age_s:g} s"
        return plain if self.cause is None else f"{plain}: {self.cause}"

    def _measured(self, age_s: float) -> str | None:
        """Rate or delay, if those are why; None if frames just do not come."""
        if len(self._frames) < _LEAST_FRAMES:
            return None
        times = [t_s for t_s, _ in self._frames]
        intervals = [b - a for a, b in pairwise(times)]
        usual_s = median(intervals)
        if usual_s <= 0:
            return None
        interval_s = mean(one for one in intervals if one <= _SILENT_INTERVALS * usual_s)
        late_s = median(age_s for _, age_s in self._frames)
        spare_s = self._max_age_s - late_s
        if age_s > late_s + _SILENT_INTERVALS * interval_s:
            return None
        if interval_s < spare_s:
            return None
        if spare_s < _SHORTEST_S:
            return f"they come {late_s:.2g} s late"
        return (
            f"camera gives {1 / interval_s:.2g} frames/s {late_s:.2g} s late, "
            f"at least {math.ceil(1 / spare_s)} are needed"
        )
