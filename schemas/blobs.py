"""What the detector sees in a frame: blobs with their pixels, and the evidence map."""

from __future__ import annotations

import zlib
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import FailFast, Field, model_validator

from heel.schemas.base import (
    BoxXyxy,
    Count,
    Dimension,
    Flag,
    Fraction,
    Message,
    Name,
    NonNegative,
    Part,
    Point,
    Real,
    Text,
)
from heel.schemas.errors import MessageError
from heel.schemas.frame import FrameId

MAX_BLOBS = 128
"""Most blobs of one message; as many as tracks, chosen by hand."""
MAX_WORK_PIXELS = 1 << 20
"""Most pixels of an evidence map: two bit planes of them, not compressible, fill the cap of its
bytes."""
# Values of the evidence map, each of two bits; moving foreground also differs from the frames
# shortly before.
NONE = 0
SHADOW = 1
FOREGROUND = 2
MOVING = 3


class Patch(Part):
    """The BGR pixels under a blob's box, at working size, row-major."""

    width: Annotated[int, Field(strict=True, ge=1, le=4096)] = Field(description="pixels")
    height: Annotated[int, Field(strict=True, ge=1, le=4096)] = Field(description="pixels")
    bgr: Annotated[bytes, Field(strict=True, max_length=1 << 20)] = Field(
        description="width x height x 3 bytes, row by row, blue first"
    )

    @model_validator(mode="after")
    def _size_matches(self) -> Self:
        if len(self.bgr) != self.width * self.height * 3:
            raise ValueError(f"{len(self.bgr)} bytes are not {self.width}x{self.height} BGR pixels")
        return self

    @classmethod
    def from_array(cls, pixels: NDArray[np.uint8]) -> Patch:
        """Pack a (H, W, 3) uint8 array."""
        height, width = pixels.shape[:2]
        return cls(width=width, height=height, bgr=pixels.tobytes())

    def array(self) -> NDArray[np.uint8]:
        """The pixels, (height, width, 3) uint8, read-only."""
        return np.frombuffer(self.bgr, np.uint8).reshape(self.height, self.width, 3)


class Blob(Part):
    """One connected foreground region that passed the true-blob test, or one detected person."""

    box_xyxy: BoxXyxy = Field(
        description="left < right, top < bottom, at most one frame's size outside"
    )
    area_px: NonNegative = Field(description="foreground pixels, frame scale")
    centroid: Point = Field(
        description="mean of the foreground pixels, of the box for people; frame pixels"
    )
    patch: Patch = Field(description="the pixels under the box")
    score: Fraction | None = Field(
        default=None,
        description="kind people: estimated probability that it is a person, with `sought` that it "
        "is the one sought; none: a foreground region",
    )
    proven: Flag = Field(
        default=True,
        description="false: nothing yet tells a person from a thing that looks like one",
    )


class Evidence(Part):
    """Per-pixel evidence at working size: none 0, shadow 1, foreground 2, moving foreground 3.

    `data` is zlib over two bit planes, the high bit then the low bit, each row-major, most
    significant bit first, padded to a whole byte at the end of the plane. A 480x360 street scene
    is 2 to 6 kB.
    """

    width: Annotated[int, Field(strict=True, ge=1, le=2048)] = Field(
        description="of the map, working pixels"
    )
    height: Annotated[int, Field(strict=True, ge=1, le=2048)] = Field(description="likewise")
    # Two planes of 2^20 pixels that zlib cannot shrink, and its own overhead.
    data: Annotated[bytes, Field(strict=True, max_length=262144 + 256)] = Field(
        description="the map, packed as told under Evidence"
    )

    @model_validator(mode="after")
    def _is_bounded(self) -> Self:
        if self.width * self.height > MAX_WORK_PIXELS:
            raise ValueError(
                f"evidence {self.width}x{self.height} exceeds {MAX_WORK_PIXELS} pixels"
            )
        return self

    @classmethod
    def from_array(cls, evidence: NDArray[np.uint8]) -> Evidence:
        """Pack a (H, W) uint8 map of 0 to 3."""
        planes = np.packbits(evidence & 2).tobytes() + np.packbits(evidence & 1).tobytes()
        height, width = evidence.shape
        return cls(width=width, height=height, data=zlib.compress(planes, 1))

    def array(self) -> NDArray[np.uint8]:
        """Unpack to a (height, width) uint8 map.

        Raises:
            MessageError: `data` does not unpack to exactly two planes of this size.
        """
        pixels = self.width * self.height
        plane_bytes = (pixels + 7) // 8
        unpacker = zlib.decompressobj()
        try:
            planes = unpacker.decompress(self.data, 2 * plane_bytes + 1)
        except zlib.error as error:
            raise MessageError(f"evidence map is not zlib data ({error}): resend it") from error
        if len(planes) != 2 * plane_bytes or not unpacker.eof:
            raise MessageError(
                f"evidence map of {self.width}x{self.height} must unpack to {2 * plane_bytes} "
                f"bytes, this one is longer, shorter or cut off: send two whole bit planes"
            )
        bits = np.frombuffer(planes, np.uint8).reshape(2, plane_bytes)
        high, low = (np.unpackbits(plane, count=pixels) for plane in bits)
        return (2 * high + low).reshape(self.height, self.width)


class CameraMotion(Part):
    """Motion of the camera since the frame before: maps old pixels to new ones."""

    affine: tuple[Real, Real, Real, Real, Real, Real] = Field(
        description="row-major 2x3 matrix, frame pixels"
    )
    quality: Fraction = Field(description="share of features that agree with it")


class Blobs(FrameId, Message):
    """Everything the tracker needs to know of one frame; sent also when nothing is seen."""

    schema_name: ClassVar[str] = "blobs"
    max_bytes: ClassVar[int] = 1 << 20

    width: Dimension
    height: Dimension
    source_width: Dimension
    source_height: Dimension
    blobs: Annotated[tuple[Blob, ...], Field(max_length=MAX_BLOBS), FailFast()] = Field(
        default=(), description="what was found in this frame"
    )
    kind: Literal["regions", "people"] = Field(
        default="regions",
        description="regions: pieces of foreground; people: one box a person, each with a score",
    )
    sought: Count | None = Field(
        default=None,
        description="kind people: there is one person alone who is looked for, and this is their "
        "number; another number is somebody else",
    )
    blobs_left_out: Count = Field(default=0, description="blobs beyond the cap of the message")
    evidence: Evidence | None = Field(
        default=None,
        description="per-pixel labels behind regions; none: kind people, or nothing new",
    )
    camera_motion: CameraMotion | None = Field(default=None, description="none: it stood still")
    detector: Name = Field(description="which detector made this, e.g. mog2")
    background: Literal["learning", "valid", "invalid"] = Field(
        default="valid", description="whether the background model can be believed"
    )
    background_reason: Text = Field(
        default="", description="why it cannot be believed, in words; empty: it can"
    )
    protected_seq: Count | None = Field(
        default=None, description="frame whose tracks were kept out of the background, if any"
    )

    @model_validator(mode="after")
    def _boxes_are_by_the_frame(self) -> Self:
        # What is farther off, tracked on, ends in numbers that no message takes: a dead tracker.
        for blob in self.blobs:
            left, top, right, bottom = blob.box_xyxy
            across = -self.width <= left < right <= 2 * self.width
            if not (across and -self.height <= top < bottom <= 2 * self.height):
                raise ValueError(
                    f"box {blob.box_xyxy} is not by a frame {self.width}x{self.height}"
                )
        return self

    @model_validator(mode="after")
    def _people_have_scores(self) -> Self:
        if self.kind == "people" and any(blob.score is None for blob in self.blobs):
            raise ValueError("kind 'people' needs a score with every blob")
        return self

    @model_validator(mode="after")
    def _one_is_sought(self) -> Self:
        if self.sought is not None and (self.kind != "people" or len(self.blobs) > 1):
            raise ValueError("'sought' needs kind 'people', and no more than one blob")
        return self
