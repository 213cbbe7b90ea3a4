"""The driver of the simulated robot."""

from __future__ import annotations

from heel.services.drive.drivers.base import Driver


class SimulatedDriver(Driver):
    """Does nothing: the simulator obeys `robot/drive` itself, with a timeout of its own."""

    def __init__(self, options: str = "") -> None:
        return

    def set_velocity(self, linear_mps: float, angular_radps: float) -> None:
        """The published `DriveState` is what moves the simulated robot."""
        return
