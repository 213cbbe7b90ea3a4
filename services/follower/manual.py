"""Who drives: the follower or a hand. Pure: what was asked and wished in, what counts now out."""

from __future__ import annotations

import math

from heel.schemas import HeelError, Manual

_LET_GO_S = 0.6
"""Seconds without a wish after which the dead man's switch counts as let go: more than any wish
holds."""


class ManualError(HeelError):
    """Driving by hand, or following, is not to be had now; the message says why."""


class ManualDrive:
    """Keeps who drives by hand, and the newest wish.

    Once taken, the robot is the hand's: it stands whenever there is no wish, and following begins
    again only when somebody hands it back. A wish counts if it carries the grant that is in force
    and is newer than all before it, so that neither a replay nor an earlier driver moves anything.
    """

    def __init__(self) -> None:
        self._grant: str | None = None
        self.source = ""
        """Who drives by hand, in words; empty: the follower drives."""
        self._seq = -1
        self._wish: Manual | None = None
        self._until_s = self._heard_s = -math.inf
        self._has_to_let_go = False

    @property
    def taken(self) -> bool:
        """Whether the robot is driven by hand, be it that it stands."""
        return self._grant is not None

    def take(self, grant: str, source: str, now_s: float) -> None:
        """Drive by hand from now on; whoever did so before does not any more.

        Args:
            grant: a new one.
            source: who asks, in words.
            now_s: monotonic time.

        Raises:
            ManualError: somebody else drives at this moment.
        """
        if self.wished(now_s) is not None and source != self.source:
            raise ManualError(f"{self.source} drives by hand now: wait until they let go")
        self._grant, self.source = grant, source
        self._forget()
        self._seq, self._has_to_let_go = -1, False

    def hand_back(self, now_s: float) -> None:
        """The follower drives again.

        Raises:
            ManualError: somebody drives at this moment.
        """
        if self.wished(now_s) is not None:
            raise ManualError(f"{self.source} drives by hand now: wait until they let go")
        self._grant, self.source = None, ""
        self._forget()

    def wish(self, wish: Manual, measured_s: float, now_s: float) -> str:
        """Take a wish; returns why it does not count, "" if it does.

        Args:
            wish: as decoded, so all its numbers are finite.
            measured_s: when the hand was there at the earliest, monotonic.
            now_s: monotonic time of its arrival.
        """
        if wish.grant != self._grant:
            return "of nobody who drives by hand now"
        if wish.seq <= self._seq:
            return f"wish {wish.seq} after {self._seq}"
        self._seq = wish.seq
        if not wish.held or now_s - self._heard_s > _LET_GO_S:
            self._has_to_let_go = False
        self._heard_s = now_s
        if not wish.held:
            self._forget()
            return ""
        if self._has_to_let_go:
            return "held since before the emergency stop: let go first"
        until_s = min(measured_s, now_s) + wish.ttl_s
        if until_s <= now_s:
            return f"{now_s - measured_s:.2f} s old"
        self._wish, self._until_s = wish, until_s
        return ""

    def stopped(self) -> None:
        """The emergency stop holds: afterwards only a hand that has let go moves anything."""
        self._forget()
        self._has_to_let_go = True

    def wished(self, now_s: float) -> tuple[float, float] | None:
        """Shares of the greatest speed ahead and to the left; None: nobody holds the switch."""
        if self._wish is None or now_s >= self._until_s:
            self._wish = None
            return None
        return self._wish.forward, self._wish.left

    def _forget(self) -> None:
        self._wish = None
