"""Ground truth of the simulated world: for files, viewers and scores, never for the services."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import FailFast, Field

from heel.schemas.base import (
    BoxXyxy,
    Count,
    Fraction,
    Message,
    Name,
    NonNegative,
    Part,
    PersonId,
    Real,
)
from heel.schemas.robot import Heading

MAX_PEOPLE = 64
"""Most people of one message; chosen by hand."""
MAX_OBSTACLES = 256
"""Most obstacles of one message; chosen by hand."""


class Pose(Part):
    """A place and a direction in the world."""

    x_m: Real = Field(description="in the axes of the world")
    y_m: Real = Field(description="likewise")
    heading_rad: Heading = Field(description="from the x axis, left is positive")


class SimPerson(Part):
    """One person of the world."""

    id: PersonId = Field(description="the same through the episode")
    role: Literal["target", "twin", "other"] = Field(
        description="the one to follow, one dressed alike, or any other"
    )
    pose: Pose = Field(description="where the person stands")
    speed_mps: NonNegative = Field(description="of walking")
    height_m: NonNegative = Field(description="of the person")
    radius_m: NonNegative = Field(description="of the person as a disc")
    box_xyxy: BoxXyxy | None = Field(
        default=None, description="in the picture, unclipped and unoccluded; none: behind"
    )
    visible: Fraction = Field(default=0.0, description="share of the box that is to be seen")


class SimObstacle(Part):
    """Wall, pillar or furniture: an upright box standing on the floor."""

    pose: Pose = Field(description="of its centre")
    length_m: NonNegative = Field(description="along its heading")
    width_m: NonNegative = Field(description="across its heading")
    height_m: NonNegative = Field(description="above the ground")
    kind: Literal["wall", "pillar", "furniture"] = Field(description="what it is")


class SimTruth(Message):
    """The world in one frame."""

    schema_name: ClassVar[str] = "sim-truth"
    max_bytes: ClassVar[int] = 65536

    seq: Count = Field(description="that of the frame")
    t_s: NonNegative = Field(description="simulated time")
    robot: Pose = Field(description="where the robot is")
    robot_radius_m: NonNegative = Field(description="of the robot as a disc")
    linear_mps: Real = Field(description="true speed, forward is positive")
    angular_radps: Real = Field(description="true turn rate, left is positive")
    people: Annotated[tuple[SimPerson, ...], Field(max_length=MAX_PEOPLE), FailFast()] = Field(
        default=(), description="everybody in the world"
    )
    contact: Count = Field(default=0, description="contacts with people so far")


class SimWorld(Message):
    """What does not move. Latched."""

    schema_name: ClassVar[str] = "sim-world"
    max_bytes: ClassVar[int] = 131072

    scenario: Name = Field(description="kind of episode")
    seed: Count = Field(description="of the episode")
    bounds_m: tuple[Real, Real, Real, Real] = Field(description="least x, y, greatest x, y")
    obstacles: Annotated[tuple[SimObstacle, ...], Field(max_length=MAX_OBSTACLES), FailFast()] = (
        Field(default=(), description="what stands in the world")
    )
