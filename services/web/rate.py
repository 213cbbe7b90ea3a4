"""Capping a rate evenly, without a clock of its own."""

from __future__ import annotations


class RateLimiter:
    """Admits events so that their mean rate stays at or below a cap.

    The next due time advances by whole periods, not from the last event: 25 events per second
    capped at 15 give 15, not the 12.5 of "at least one period apart".

    Args:
        max_hz: the cap, events per second.
    """

    def __init__(self, max_hz: float) -> None:
        self._period_s = 1.0 / max_hz
        self._due_s = float("-inf")

    def admit(self, now_s: float) -> bool:
        """Whether an event at `now_s` (monotonic) may pass."""
        if now_s < self._due_s:
            return False
        # After a pause nothing is caught up: at most one event comes early.
        self._due_s = max(self._due_s + self._period_s, now_s)
        return True
