"""Settings of the robot's end: its driver, its watchdog and limits of its own."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from heel.schemas.base import Name
from heel.services.runtime.settings import ServiceSettings, StrictSettings


class DriveSettings(StrictSettings):
    """When the wheels may turn, and how fast: by default a little above what the follower asks."""

    driver: Name = Field(
        "log",
        description="what turns the wheels: log, record, simulated, or an installed one (entry "
        "points of the group heel.drivers)",
    )
    rate_hz: float = Field(
        50.0,
        ge=20,
        le=200,
        description="rounds of the watchdog per second: more stop sooner, at more CPU",
    )
    ttl_s: float = Field(
        0.5, gt=0, le=2, description="zero velocity so long after the last command, s, or after "
        "the command's own ttl where that is shorter: less stops sooner, and stutters on a bad link"
    )  # fmt: skip
    max_linear_mps: float = Field(
        2.0, ge=0, le=5, description="speed limit, forward, m/s; the follower's own is asked first"
    )
    max_reverse_mps: float = Field(0.3, ge=0, le=5, description="speed limit, backward, m/s")
    max_angular_radps: float = Field(2.0, ge=0, le=10, description="turn rate limit, rad/s")
    max_linear_mps2: float = Field(
        2.0, gt=0, le=20, description="acceleration limit, m/s^2; slowing down is not limited by it"
    )
    max_angular_radps2: float = Field(
        6.0, gt=0, le=50, description="angular acceleration limit, rad/s^2; slowing down ignores it"
    )
    braking_mps2: float | None = Field(
        None, gt=0, le=50, description="deceleration of every stop, m/s^2, so that a tall robot "
        "does not tip; each stop then takes speed / deceleration longer. Without it zero comes at "
        "once"
    )  # fmt: skip


class DriveServiceSettings(ServiceSettings, DriveSettings):
    """Settings of the drive process."""

    delivery: Literal["live"] = Field("live", description="a robot is driven live")
    driver_options: str = Field(
        "", max_length=512, description="what the driver is told, e.g. its serial port"
    )
    driver_deadline_s: float = Field(
        0.3,
        gt=0,
        le=1,
        description="a driver that takes longer for one call, s, has failed: less finds a hung "
        "motor board sooner, and fails slow serial lines",
    )
