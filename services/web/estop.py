"""What the page knows of the emergency stop, and when a stop must be said again."""

from __future__ import annotations

REPEAT_AFTER_S = 0.5


class StopLatch:
    """Follows the emergency stop; a stop asked for here is repeated until it is confirmed.

    A STOP pressed while the router is away must not get lost: it stays pending and goes out as
    soon as somebody can hear it. A resume is never repeated.
    """

    def __init__(self) -> None:
        self.engaged = False
        self.source = ""
        self._confirmed = False
        self._pending_since_s: float | None = None
        self._said_s = 0.0

    def engage(self, source: str, now_s: float) -> None:
        """Somebody pressed STOP on the page."""
        self.hear(True, source)
        self._pending_since_s = self._said_s = now_s

    def release(self, source: str) -> None:
        """Somebody pressed resume on the page."""
        self.hear(False, source)

    def hear(self, engaged: bool, source: str) -> None:
        """A stop or a resume went over `follow/estop`, whoever sent it."""
        self.engaged, self.source, self._confirmed = engaged, source, False
        if not engaged:
            self._pending_since_s = None

    def follower_says(self, stopped: bool) -> None:
        """The follower is the one who knows, except of a stop that has not reached it yet."""
        if stopped:
            self.engaged = self._confirmed = True
            self._pending_since_s = None
        elif self._confirmed:
            self.engaged = self._confirmed = False

    def pending_s(self, now_s: float) -> float | None:
        """How long a stop has waited for its confirmation; None if none does."""
        return None if self._pending_since_s is None else now_s - self._pending_since_s

    def repeat_due(self, now_s: float) -> bool:
        """Whether the stop is to be said again now; True counts as said."""
        if self._pending_since_s is None or now_s - self._said_s < REPEAT_AFTER_S:
            return False
        self._said_s = now_s
        return True
