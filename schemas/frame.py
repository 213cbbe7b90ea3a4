"""Which frame a message is about, and the stamps that travel in attachments."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from heel.schemas.base import (
    AgeNs,
    Count,
    Dimension,
    Message,
    Name,
    Part,
    Point,
    Real,
    Text,
    TimeNs,
)

Producer = Annotated[
    str, Field(strict=True, pattern=r"^[a-z0-9_-]{1,64}/[a-z0-9_-]{1,64}@[0-9a-f]{8}$")
]
"""`service/instance@start`: `start` is random per process, so a restart is another producer."""

Focal = Annotated[float, Field(strict=True, gt=0, le=1e6, description="pixels")]
ImageEncoding = Literal["image/raw;bgr8", "image/jpeg", "image/raw;depth16"]


class FrameId(Part):
    """Names one frame. Capture makes it; every later message repeats it verbatim."""

    stream: Name = Field(description="camera name")
    epoch: Count = Field(description="random per capture start; seq restarts with it")
    seq: Count = Field(description="frame number within the epoch, from 0, without gaps")
    index: Count = Field(
        description="position on the source's own timeline: ground-truth frame minus 1"
    )
    t_capture_ns: TimeNs = Field(
        description="acquisition time: wall clock when live, media time in a lossless run"
    )

    def frame_id(self) -> FrameId:
        """The part that later messages repeat."""
        return FrameId(
            stream=self.stream,
            epoch=self.epoch,
            seq=self.seq,
            index=self.index,
            t_capture_ns=self.t_capture_ns,
        )


class Header(FrameId, Message):
    """Attachment of an image or a depth picture: everything about the pixels but the pixels."""

    schema_name: ClassVar[str] = "header"
    max_bytes: ClassVar[int] = 1024

    width: Dimension
    height: Dimension
    source_width: Dimension = Field(description="width before capture scaled the frame")
    source_height: Dimension = Field(description="height before capture scaled the frame")
    image_encoding: ImageEncoding = Field(
        description="of the payload: rows of blue, green, red bytes, or a JPEG; of a depth picture "
        "rows of millimetres along the optical axis, two bytes each, the low one first, 0 where "
        "nothing was measured"
    )
    producer: Producer = Field(description="the capture process")
    age_ns: AgeNs = Field(default=0, description="monotonic time from acquisition to sending")


class Stamp(Message):
    """Attachment of blobs, tracks and commands: who sent it and how old the frame is by now.

    It is kept out of the payload so that the payload of a lossless run is the same bytes whoever
    computes it and whenever.
    """

    schema_name: ClassVar[str] = "stamp"
    max_bytes: ClassVar[int] = 768

    producer: Producer = Field(description="the process that computed the payload")
    t_sent_ns: TimeNs = Field(description="wall clock when sent; for display, never for safety")
    age_ns: AgeNs = Field(
        description="monotonic time since acquisition spent inside services, transit not counted"
    )
    line: Producer | None = Field(
        default=None,
        description="the process whose work this one has taken over, by way of others perhaps, and "
        "whose ids it goes on with; none: it began by itself",
    )
    turn: Count = Field(
        default=0,
        description="how often the line has been taken over: of two processes of one line the one "
        "with the higher turn is believed, at once",
    )
    successor: Producer | None = Field(
        default=None, description="who takes over from the next message on, by agreement"
    )

    @property
    def origin(self) -> str:
        """The first process of the line: the ids of tracks are those that it began with."""
        return self.line or self.producer


class Taken(Message):
    """When a frame was taken, told at once and past everything that works on its pixels.

    Who follows bounds the age of a frame with it, so that time spent on links counts as well. Live
    only.
    """

    schema_name: ClassVar[str] = "taken"
    max_bytes: ClassVar[int] = 512

    stream: Name = Field(description="camera name")
    epoch: Count = Field(description="of the frame")
    seq: Count = Field(description="of the frame")
    clock: Annotated[str, Field(strict=True, pattern=r"^[0-9a-f-]{1,64}$")] = Field(
        description="whose monotonic clock it is: equal on one host since one boot"
    )
    monotonic_ns: TimeNs = Field(description="acquisition, on that clock")


class LensModel(Part):
    """Focal lengths, principal point and distortion of a lens, for the published picture."""

    model: Literal["plumb_bob", "equidistant"] = Field(
        description="of the distortion: Brown's, as OpenCV orders it (k1 k2 p1 p2 k3 k4 k5 k6), or "
        "a fisheye's (k1 to k4)"
    )
    focal_px: tuple[Focal, Focal] = Field(description="across and down")
    centre_px: Point = Field(description="principal point")
    coefficients: Annotated[tuple[Real, ...], Field(max_length=8)] = Field(
        default=(), description="of the distortion; missing ones are 0"
    )


class CameraInfo(Message):
    """What is known of the camera. Latched."""

    schema_name: ClassVar[str] = "info"
    max_bytes: ClassVar[int] = 4096

    stream: Name = Field(description="camera name")
    epoch: Count = Field(description="of the frames that it counts for")
    width: Dimension
    height: Dimension
    source_width: Dimension
    source_height: Dimension
    fps: Annotated[
        float, Field(strict=True, gt=0, le=1000, description="nominal frames per second")
    ]
    frame_count: Count | None = Field(default=None, description="frames a recording announces")
    source: Text = Field(description="what the frames come from, for people")
    horizontal_fov_rad: Annotated[float, Field(strict=True, gt=0, lt=3.1416)] | None = Field(
        default=None, description="field of view of the whole picture; none: not known"
    )
    mount_height_m: Annotated[float, Field(strict=True, ge=0, le=100)] | None = Field(
        default=None, description="camera above the ground; none: not known"
    )
    mount_pitch_rad: Real | None = Field(default=None, description="down is positive")
    lens: LensModel | None = Field(
        default=None, description="none: a pinhole without distortion is assumed"
    )
    mount_yaw_rad: Real | None = Field(
        default=None, description="from the robot's ahead to the camera's, left is positive"
    )
    host: Annotated[str, Field(strict=True, pattern=r"^[0-9a-f-]{0,64}$")] = Field(
        default="",
        description="of the camera's process, named as in `taken.clock`; where it is named the "
        "frames can be had as JPEG, too",
    )
    depth: bool = Field(
        default=False,
        description="whether every frame of a lossless run has a depth picture, so that the "
        "tracker waits for it; a live camera does not say",
    )


class EndOfStream(Message):
    """Sent in band after the last frame, and passed on by each stage after its last result."""

    schema_name: ClassVar[str] = "end"
    max_bytes: ClassVar[int] = 4096

    stream: Name = Field(description="camera name")
    epoch: Count = Field(description="that is over")
    frames: Count = Field(description="frames sent in this epoch")
    reason: Text = Field(description="why, in words")


class Progress(Message):
    """What a lossless consumer has finished with: the credit for back-pressure."""

    schema_name: ClassVar[str] = "progress"
    max_bytes: ClassVar[int] = 512

    stream: Name = Field(description="camera name")
    epoch: Count = Field(description="of the frame")
    seq: Count = Field(description="the newest frame that is done with")
