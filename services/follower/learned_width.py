"""How wide a person is, learned while what is seen of the person tells the distance.

The width of a box says little of a stranger's distance: it may be a child, or have a ladder along.
Of a person of known width it goes on telling when a table hides the feet, when the head goes
down, and when the picture's border cuts off both.
"""

from __future__ import annotations

import math

_MEMORY_S = 4.0
"""Seconds: some strides, which widen a box seen from the side."""
_LONG_MEMORY_S = 10.0
"""Seconds: longer than it takes to sit down."""
_WIDEST_M = 1.0
"""Metres; wider than that is no one person. Chosen by hand."""
_ENOUGH_S = 0.3
"""Seconds of certain sight from which the width is used; chosen by hand."""


class LearnedWidth:
    """Of one person.

    Attributes:
        width_m: None before it is known.
    """

    def __init__(self) -> None:
        self._mean_m = 0.0
        self._taught_s = 0.0
        self._t_s: float | None = None

    @property
    def width_m(self) -> float | None:
        """None before a few boxes have taught it."""
        return self._mean_m if self._taught_s >= _ENOUGH_S else None

    def learn(self, width_m: float, t_s: float, feet_seen: bool) -> None:
        """Take in a box of which the distance is certain.

        Args:
            width_m: of the box at that distance.
            t_s: when it was seen, not before the last one's.
            feet_seen: whether the distance rests on the feet. If not, it does on the head of
                somebody who may be about to sit down.
        """
        dt_s = 0.05 if self._t_s is None else min(max(t_s - self._t_s, 0.0), 0.2)
        self._t_s = t_s
        self._taught_s += dt_s
        # At first the mean of all, then of the last strides.
        memory_s = _MEMORY_S if feet_seen else _LONG_MEMORY_S
        share = 1.0 - math.exp(-dt_s / min(self._taught_s, memory_s))
        share = 1.0 if self._mean_m == 0.0 else share
        self._mean_m += share * (min(width_m, _WIDEST_M) - self._mean_m)
