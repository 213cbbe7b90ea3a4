"""People with identities, one message per frame."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import FailFast, Field

from heel.schemas.base import (
    BoxXyxy,
    Count,
    Dimension,
    Flag,
    Fraction,
    Message,
    NonNegative,
    Part,
    PersonId,
    Point,
    Real,
)
from heel.schemas.blobs import CameraMotion
from heel.schemas.frame import FrameId

MAX_TRACKS = 128
TrackState = Literal["new", "tracked", "occluded", "lost"]


class Track(Part):
    """One person.

    `new` is not confirmed yet and not shown; `tracked` is seen in this frame; `occluded` is
    predicted behind another person or within a group; `lost` is predicted with nothing seen.
    """

    id: PersonId = Field(description="never used again for another person by this tracker")
    state: TrackState
    box_xyxy: BoxXyxy
    velocity_pxps: Point = Field(description="of the box centre, pixels per second")
    area_px: NonNegative = Field(description="the paper's A: area of the box")
    span_px: NonNegative = Field(description="the paper's s: width of the box")
    identity_confidence: Fraction = Field(description="that the id is still on the same person")
    runner_up_confidence: Fraction = Field(
        default=0.0, description="the same, for the best other known person"
    )
    occluded_by: Annotated[tuple[PersonId, ...], Field(max_length=MAX_TRACKS), FailFast()] = ()
    missed_frames: Count = 0
    shown: Flag = Field(description="whether a user is shown this box and files receive it")
    proven: Flag = Field(
        default=True,
        description="false: nothing yet tells a person from a thing; robots only turn to it",
    )
    distance_m: NonNegative | None = Field(
        default=None, description="from the camera along the ground; none: not calibrated"
    )
    distance_sigma_m: NonNegative | None = Field(default=None, description="standard deviation")
    bearing_rad: Real | None = Field(default=None, description="left is positive")
    bearing_sigma_rad: NonNegative | None = Field(default=None, description="standard deviation")


class Tracks(FrameId, Message):
    """All people in one frame; sent also when there are none."""

    schema_name: ClassVar[str] = "tracks"
    max_bytes: ClassVar[int] = 262144

    width: Dimension
    height: Dimension
    source_width: Dimension
    source_height: Dimension
    tracks: Annotated[tuple[Track, ...], Field(max_length=MAX_TRACKS), FailFast()] = ()
    occlusion: Flag = Field(default=False, description="the paper's test, eq. 4, in this frame")
    camera_motion: CameraMotion | None = Field(
        default=None,
        description="as the detector tells it, the identity where it stood still; none: not told",
    )
