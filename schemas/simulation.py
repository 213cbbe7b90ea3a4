"""The simulated world as it really is: for files, viewers and scores, never for the stack."""

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
MAX_OBSTACLES = 256


class Pose(Part):
    """A place and a direction in the world."""

    x_m: Real
    y_m: Real
    heading_rad: Heading


class SimPerson(Part):
    """One person of the world."""

    id: PersonId
    role: Literal["target", "twin", "other"]
    pose: Pose
    speed_mps: NonNegative
    height_m: NonNegative
    radius_m: NonNegative
    box_xyxy: BoxXyxy | None = Field(
        default=None, description="in the picture, unclipped and unoccluded; none: behind"
    )
    visible: Fraction = Field(default=0.0, description="share of the box that is to be seen")


class SimObstacle(Part):
    """Wall, pillar or furniture: an upright box standing on the floor."""

    pose: Pose = Field(description="of its centre")
    length_m: NonNegative = Field(description="along its heading")
    width_m: NonNegative
    height_m: NonNegative
    kind: Literal["wall", "pillar", "furniture"]


class SimTruth(Message):
    """The world in one frame."""

    schema_name: ClassVar[str] = "sim-truth"
    max_bytes: ClassVar[int] = 65536

    seq: Count = Field(description="that of the frame")
    t_s: NonNegative = Field(description="simulated time")
    robot: Pose
    robot_radius_m: NonNegative
    linear_mps: Real
    angular_radps: Real
    people: Annotated[tuple[SimPerson, ...], Field(max_length=MAX_PEOPLE), FailFast()] = ()
    contact: Count = Field(default=0, description="contacts with people so far")


class SimWorld(Message):
    """What does not move. Latched."""

    schema_name: ClassVar[str] = "sim-world"
    max_bytes: ClassVar[int] = 131072

    scenario: Name
    seed: Count
    bounds_m: tuple[Real, Real, Real, Real] = Field(description="least x, y, greatest x, y")
    obstacles: Annotated[tuple[SimObstacle, ...], Field(max_length=MAX_OBSTACLES), FailFast()] = ()
