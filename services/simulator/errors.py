"""What a simulated world refuses."""

from __future__ import annotations

from heel.schemas import HeelError


class SimulatorError(HeelError):
    """A world, camera or scenario that is asked for what it cannot do."""
