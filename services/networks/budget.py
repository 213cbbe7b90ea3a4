"""How much of the network a frame gets when its time is bounded.

Whole frames as long as they fit. Otherwise whole frames at a lower rate, and between them closer
looks at parts of the frame where they leave enough for the next whole one. Times are measured
where the network runs and given here as numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

_MEMORY = 0.2  # Weight of a new measurement in the running mean of what a look costs
_LONGEST_PERIOD = 12  # Frames between whole frames up to which closer looks may put them off
_SAVED_LOOKS = 2.0
"""Time that is not used is saved, up to so many whole frames: a burst later on is bounded."""


@dataclass(frozen=True, slots=True)
class Looks:
    """What to run the network on in this frame."""

    whole: bool
    parts: int


class Budget:
    """Keeps the mean time of the network a frame within a bound."""

    def __init__(self, budget_ms: float) -> None:
        """Bound it to `budget_ms` a frame; 0: no bound, everything is looked at."""
        self._budget_ms = budget_ms
        self._saved_ms = 0.0
        self._whole_ms: float | None = None
        self._part_ms: float | None = None
        self._since_whole = 0

    def choose(self, parts_wanted: int, whole_due: bool = True) -> Looks:
        """What to look at in the next frame.

        Args:
            parts_wanted: how many parts of the frame are worth a closer look.
            whole_due: whether it is time for a whole frame, where they have a period of their own.
        """
        if self._budget_ms == 0:
            return Looks(whole_due, parts_wanted)
        self._since_whole += 1
        most_ms = max(self._budget_ms, _SAVED_LOOKS * (self._whole_ms or self._budget_ms))
        self._saved_ms = min(self._saved_ms + self._budget_ms, most_ms)
        if self._whole_ms is None:
            return Looks(True, 0)
        if not whole_due:
            return Looks(False, self._affordable(parts_wanted, self._saved_ms))
        due_in = max(0, self._period() - self._since_whole) if parts_wanted else 0
        if due_in == 0:
            if self._saved_ms < self._whole_ms:
                return Looks(False, 0)
            return Looks(True, self._affordable(parts_wanted, self._saved_ms - self._whole_ms))
        later_ms = self._saved_ms + due_in * self._budget_ms - self._whole_ms
        return Looks(False, self._affordable(parts_wanted, min(self._saved_ms, later_ms)))

    def spent(self, whole_ms: float | None, parts_ms: Sequence[float]) -> None:
        """Say what the looks of the last frame took, None for a whole frame not looked at."""
        self._saved_ms -= (whole_ms or 0.0) + sum(parts_ms)
        if whole_ms is not None:
            self._whole_ms = _blended(self._whole_ms, whole_ms)
            self._since_whole = 0
        for part_ms in parts_ms:
            self._part_ms = _blended(self._part_ms, part_ms)

    def _affordable(self, wanted: int, left_ms: float) -> int:
        part_ms = self._part_ms or self._whole_ms or left_ms
        return max(0, min(wanted, int(left_ms // max(part_ms, 1e-6))))

    def _period(self) -> int:
        """Frames from one whole frame to the next, with a closer look in each between."""
        whole_ms = self._whole_ms or 0.0
        part_ms = whole_ms if self._part_ms is None else self._part_ms
        if whole_ms <= self._budget_ms:
            return 1
        spare_ms = self._budget_ms - part_ms
        if spare_ms <= 0:
            return _LONGEST_PERIOD
        return min(_LONGEST_PERIOD, math.ceil((whole_ms - part_ms) / spare_ms))


def _blended(before: float | None, now: float) -> float:
    return now if before is None else before + _MEMORY * (now - before)
