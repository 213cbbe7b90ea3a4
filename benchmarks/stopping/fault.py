"""What one row of the table is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from benchmarks.stopping.rig import Rig

WATCH_S = 0.4
"""How long the robot has to go on standing for a stop to count."""


@dataclass(frozen=True)
class Fault:
    """One row of the table: how to bring the fault about, and how to undo it."""

    name: str
    bound_ms: float
    inject: Callable[[Rig], int | None]
    """Gives the monotonic nanosecond of the fault where that is not the call's own."""
    lift: Callable[[Rig], None]
    watch_s: float = WATCH_S
    afterwards: Callable[[Rig], None] | None = None
    """What must not make it move again."""
    perception: bool = True
    """Whether it takes a real camera, detector and tracker."""
    in_ms: Callable[[Rig, int], float] | None = None
    """What is measured, given the time of the fault, where it is not the time to zero."""
