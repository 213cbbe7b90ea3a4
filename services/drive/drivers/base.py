"""What a driver is: the few calls between the drive and a robot's wheels."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class OdometryReading:
    """Where the wheels say the robot is since it started: x ahead and y left at the start.

    `linear_mps` forward and `angular_radps` left are positive.
    """

    x_m: float
    y_m: float
    heading_rad: float
    linear_mps: float
    angular_radps: float


class Driver(ABC):
    """The wheels of one robot.

    All calls come from one thread, except that a last `stop` may come from another one while a
    call hangs. A call may raise anything and must return within `driver_deadline_s`: otherwise
    the drive tries to stop the wheels and ends with exit code 1. Made with one string, the
    setting `driver_options`.
    """

    @abstractmethod
    def set_velocity(self, linear_mps: float, angular_radps: float) -> None:
        """Turn the wheels like this until told otherwise; called at `rate_hz`, also unchanged."""

    def stop(self) -> None:
        """Zero velocity at once; called at `rate_hz` while the robot stands, and on the way out."""
        self.set_velocity(0.0, 0.0)

    def close(self) -> None:
        """Let go of the device, after a last `stop`."""
        return

    def odometry(self) -> OdometryReading | None:
        """The newest reading, if the wheels have one; asked for after every command."""
        return None
