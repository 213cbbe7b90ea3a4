"""By what share a person's box misleads about the distance, learned from the range sensor.

A person is not of the assumed height, and a detector's box may miss the feet in every frame: with
a box of 0.8 of the person, one 1.3 m ahead is taken to be 2.1 m away, and the robot comes as near
as ranges let it.
"""

from __future__ import annotations

import math

_GATE_M = 0.35
"""Metres by which range and box may differ and mean the same person; chosen by hand."""
_MEMORY_S = 1.0
"""Seconds in which an older scale falls to 1/e; chosen by hand."""
_LASTING_S = 1.0
"""Seconds: a person that crosses in front is gone by then, and a thing that stands there for longer
hides the person."""
_LEAST = 0.5
"""Least real distance by what the box says: a box without the legs. Chosen by hand."""
_MOST = 1.25
"""Greatest real distance by what the box says: a tall person. Chosen by hand."""
_NEAREST_M = 0.1
"""A share of less than that says nothing; trackers may tell 0 m."""


class BoxScale:
    """Of one person.

    Attributes:
        scale: real distance by what the box says, in [0.5, 1.25].
    """

    def __init__(self) -> None:
        self.scale = 1.0
        self._t_s: float | None = None
        self._off_s = 0.0
        self._agreed_s = -math.inf

    def measured(self, t_s: float) -> bool:
        """Whether a range has lately said the same as the box."""
        return t_s - self._agreed_s <= _LASTING_S

    def learn(self, told_m: float, measured_m: float, t_s: float) -> None:
        """Take in one frame.

        Args:
            told_m: distance by the box.
            measured_m: by the range in that direction.
            t_s: when it was, not before the last one's.
        """
        if told_m < _NEAREST_M:
            return
        dt_s = 0.0 if self._t_s is None else min(max(0.0, t_s - self._t_s), _LASTING_S)
        self._t_s = t_s
        off_m = measured_m - self.scale * told_m
        # A ray that misses the person hits the wall behind: it never makes the scale greater.
        most = _MOST if off_m <= _GATE_M else max(1.0, self.scale)
        self._off_s = self._off_s + dt_s if abs(off_m) > _GATE_M else 0.0
        if abs(off_m) <= _GATE_M:
            self._agreed_s = t_s
        elif self._off_s < _LASTING_S:
            return
        wanted = min(max(measured_m / told_m, _LEAST), most)
        self.scale += (1.0 - math.exp(-dt_s / _MEMORY_S)) * (wanted - self.scale)
