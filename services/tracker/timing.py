"""Time between frames, from their acquisition times alone."""

from __future__ import annotations

FIRST_STEP_S = 0.04
"""Seconds assumed before the first frame, from which no step is known: 25 frames a second."""
MIN_STEP_S = 0.001
"""Seconds: no camera here is faster, and a velocity is divided by the step; chosen by hand."""
MAX_STEP_S = 5.0
"""Seconds: over a longer pause no motion model says anything; chosen by hand."""


class FrameClock:
    """Turns acquisition times into steps that a motion model can bear.

    Attributes:
        t_s: sum of the steps so far.
    """

    def __init__(self) -> None:
        self.t_s = 0.0
        self._last_ns: int | None = None
        self._step_s = FIRST_STEP_S

    def elapsed_s(self, t_capture_ns: int) -> float:
        """Seconds since the frame before, `MIN_STEP_S` to `MAX_STEP_S`.

        A clock that stands still or runs backwards repeats the step before.
        """
        if self._last_ns is not None and t_capture_ns > self._last_ns:
            self._step_s = (t_capture_ns - self._last_ns) / 1e9
        self._last_ns = t_capture_ns
        step_s = min(MAX_STEP_S, max(MIN_STEP_S, self._step_s))
        self.t_s += step_s
        return step_s
