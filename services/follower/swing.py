"""A robot that swings to and fro before a person: it obeys later than assumed."""

from __future__ import annotations

import math
from collections import deque

_PEAK_RADPS = 0.3
"""A person that walks about is followed by slower turning; a delay of 0.2 s more swings at 0.5 to
1.5 rad/s."""
_SHORTEST_S = 0.4
"""Of one way, half a period: an unforeseen delay of 0.3 to 0.5 s gives 1.0 to 1.8 s."""
_LONGEST_S = 2.6
"""Of one way, half a period; slower turning to and fro follows a person."""
_WAYS = 4
"""To and fro twice: no person dodges so evenly for so long."""
_EVEN = 1.8
"""Greatest way over the least one, in time."""
_CALMER = 0.5
"""Share of the turning that is left after a swing; chosen by hand."""
_CALMEST = 0.2
"""Least share of the turning: the robot still keeps the person in sight. Chosen by hand."""
_FORGET_S = 60.0
"""In which the turning gets 1/e of its briskness back: a person may have played, after all."""


class Swing:
    """Watches the turn rates that are told, and turns more gently while they go to and fro.

    A delay that is not compensated makes a feedback loop of too much gain swing for ever; with
    less it settles.
    """

    def __init__(self) -> None:
        self._ways: deque[float] = deque(maxlen=_WAYS)
        self._side = 0.0
        self._peak_s = 0.0
        self._now_s: float | None = None
        self._lacking = 0.0

    @property
    def share(self) -> float:
        """Of its gain with which to turn, (0, 1]."""
        return 1.0 - self._lacking

    @property
    def swings(self) -> bool:
        """Whether it has swung lately."""
        return self._lacking > 0.25

    def told(self, now_s: float, angular_radps: float) -> None:
        """Note the turn rate of this moment."""
        if self._now_s is not None:
            self._lacking *= math.exp(-max(now_s - self._now_s, 0.0) / _FORGET_S)
        self._now_s = now_s
        if abs(angular_radps) < _PEAK_RADPS:
            if now_s - self._peak_s > _LONGEST_S:
                self._ways.clear()
            return
        side = math.copysign(1.0, angular_radps)
        if side == self._side:
            return
        way_s = now_s - self._peak_s
        self._side, self._peak_s = side, now_s
        if not _SHORTEST_S <= way_s <= _LONGEST_S:
            self._ways.clear()
            return
        self._ways.append(way_s)
        if len(self._ways) == _WAYS and max(self._ways) <= _EVEN * min(self._ways):
            self._ways.clear()
            self._lacking = 1.0 - max(_CALMEST, _CALMER * self.share)
