"""Messages of the robot itself: odometry, ranges, and the velocities that its wheels get."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, FailFast, Field

from heel.schemas.base import Count, Flag, Message, Name, NonNegative, Part, Real

MAX_SECTORS = 720
"""Most sectors of one message: a scan of half a degree all around."""
MAX_RANGE_M = 1000.0
"""Largest finite distance [m], above the reach of a robot's sensors; chosen by hand."""
Heading = Annotated[float, Field(strict=True, ge=-math.pi, le=math.pi)]
"""Radians, left is positive, 0 is straight ahead (of the robot) or along x (of the world)."""


class Odometry(Message):
    """Where the robot believes it is since its start. x ahead and y left at the start."""

    schema_name: ClassVar[str] = "odometry"
    max_bytes: ClassVar[int] = 1024

    seq: Count = Field(description="goes up by one with each message")
    x_m: Real = Field(description="since its start, ahead as it stood then; may drift, never jumps")
    y_m: Real = Field(description="likewise, to the left as it stood then")
    heading_rad: Heading = Field(description="since its start, left is positive")
    linear_mps: Real = Field(description="forward is positive")
    angular_radps: Real = Field(description="left is positive")


def _is_range(distance_m: float) -> float:
    # Not `ge` and `le`: infinity and NaN have meanings in a range, by REP 117 of ROS.
    if math.isfinite(distance_m) and not 0.0 <= distance_m <= MAX_RANGE_M:
        raise ValueError(f"Input should be 0 to {MAX_RANGE_M:g} metres, inf, -inf or nan")
    return distance_m


Distance = Annotated[
    float,
    Field(
        strict=True, allow_inf_nan=True,
        json_schema_extra={"minimum": 0, "maximum": int(MAX_RANGE_M)},
    ),
    AfterValidator(_is_range),
]  # fmt: skip


class RangeSector(Part):
    """The nearest thing within one sector around the robot."""

    bearing_rad: Heading = Field(description="centre of the sector")
    width_rad: Annotated[float, Field(strict=True, gt=0, le=2 * math.pi)] = Field(
        description="of the sector"
    )
    distance_m: Distance = Field(
        description="from the robot's centre; inf or the sensor's greatest range: nothing seen; "
        "-inf: too near to measure; nan: not measured"
    )


class Ranges(Message):
    """Free distances from sonar, lidar or depth. Sectors may overlap and leave gaps."""

    schema_name: ClassVar[str] = "ranges"
    max_bytes: ClassVar[int] = 65536

    seq: Count = Field(description="goes up by one with each message")
    sectors: Annotated[tuple[RangeSector, ...], Field(max_length=MAX_SECTORS), FailFast()] = Field(
        description="what is measured now, in any order"
    )


class DriveState(Message):
    """What the wheels are told at this moment, and why. Sent at a fixed rate, never latched."""

    schema_name: ClassVar[str] = "drive"
    max_bytes: ClassVar[int] = 1024

    seq: Count = Field(description="goes up by one with each message")
    state: Literal["waiting", "driving", "stopped"] = Field(
        description="waiting: no command yet; stopped: zero velocity for the reason given"
    )
    reason: Annotated[str, Field(strict=True, max_length=96)] = Field(description="why, in words")
    estop: Flag = Field(description="whether an emergency stop holds")
    driver: Name = Field(description="that turns the wheels")
    linear_mps: Real = Field(description="forward is positive")
    angular_radps: Real = Field(description="left is positive")
    command_seq: Count | None = Field(default=None, description="the command it rests on")
    command_age_s: NonNegative | None = Field(default=None, description="since its arrival")
