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
"""Most tracks of one message; as many as blobs, chosen by hand."""
TrackState = Literal["new", "tracked", "occluded", "lost"]


class Track(Part):
    """One person, and what every tracker means by it.

    State, from the frame of the message alone:

    - `new`: not yet confirmed to be a person; never shown. A tracker need not report these.
    - `tracked`: measured on its own: by a box or a region of its own, or with at least half of the
      person in view.
    - `occluded`: other tracks keep it from being measured on its own. It is measured only together
      with them (`missed_frames` 0), or not at all and they hide it.
    - `lost`: not measured, and no track hides it; the box is predicted.

    `tracked` means `missed_frames` 0, `lost` means more.
    """

    id: PersonId = Field(description="never used again for another person by this tracker")
    state: TrackState = Field(
        description="`tracked`: measured on its own in this frame; `occluded`: other tracks keep "
        "it from that; `lost`: not measured, hidden by no track; `new`: not confirmed, never shown"
    )
    box_xyxy: BoxXyxy = Field(description="estimated, of the whole person, also where hidden")
    velocity_pxps: Point = Field(description="of the box centre, pixels per second")
    area_px: NonNegative = Field(description="the paper's A: area of the box")
    span_px: NonNegative = Field(description="the paper's s: width of the box")
    identity_confidence: Fraction = Field(
        description="estimated probability that the box is on the person who was given the id: "
        "lower after contacts and time unseen, until appearance or motion settle it"
    )
    runner_up_confidence: Fraction = Field(
        default=0.0,
        description="the same for the best other known person; the two are at most 1 together",
    )
    occluded_by: Annotated[
        tuple[PersonId, ...],
        Field(
            max_length=MAX_TRACKS,
            description="state `occluded` only: the tracks of this message that stand before it, "
            "nearest first; empty for the foremost of those that are measured together",
        ),
        FailFast(),
    ] = ()
    missed_frames: Count = Field(
        default=0,
        description="frames in a row, up to this one, in which nothing of it was measured",
    )
    shown: Flag = Field(description="whether a user is shown this box and files receive it")
    proven: Flag = Field(
        default=True,
        description="false: nothing yet tells a person from a thing; robots only turn to it",
    )
    distance_m: NonNegative | None = Field(
        default=None,
        description="measured, from the camera along the ground to the middle of the body, as "
        "by depth; none: not measured: the follower then estimates it from the box",
    )
    distance_sigma_m: NonNegative | None = Field(
        default=None, description="standard deviation of it; none: 10 % of the distance"
    )
    bearing_rad: Real | None = Field(
        default=None,
        description="measured, left is positive; none: the follower takes the middle of the box",
    )
    bearing_sigma_rad: NonNegative | None = Field(
        default=None, description="standard deviation of it; none: 0.02"
    )


class Tracks(FrameId, Message):
    """All people in one frame; sent also when there are none."""

    schema_name: ClassVar[str] = "tracks"
    max_bytes: ClassVar[int] = 262144

    width: Dimension = Field(description="of the frame that boxes are in, pixels")
    height: Dimension = Field(description="likewise")
    source_width: Dimension = Field(description="of the picture before capture scaled it, pixels")
    source_height: Dimension = Field(description="likewise")
    tracks: Annotated[
        tuple[Track, ...],
        Field(max_length=MAX_TRACKS, description="everybody who is known, by id"),
        FailFast(),
    ] = ()
    occlusion: Flag = Field(default=False, description="whether any track is `occluded`")
    camera_motion: CameraMotion | None = Field(
        default=None,
        description="as the detector tells it, the identity where it stood still; none: not told",
    )


class TrackEvent(Message):
    """What a tracker found out about an identity, in words. A few a second at most."""

    schema_name: ClassVar[str] = "event"
    max_bytes: ClassVar[int] = 2048

    frame: FrameId = Field(description="in which it was found out")
    kind: Annotated[str, Field(strict=True, min_length=1, max_length=32)] = Field(
        description="what happened, in a word or two; as in a trace"
    )
    ids: Annotated[tuple[PersonId, ...], Field(min_length=1, max_length=2), FailFast()] = Field(
        description="of the tracks that it is about"
    )
    text: Annotated[str, Field(strict=True, max_length=300)] = Field(
        description="the same as a sentence, without a full stop"
    )
