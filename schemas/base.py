"""Base of all messages: immutability, finiteness, a version and a size cap."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import BaseModel, ConfigDict, Field

MAX_DIMENSION_PX = 16384
"""Largest side of a frame [px]; 8K is 7680."""

Name = Annotated[str, Field(strict=True, pattern=r"^[a-z0-9_-]{1,64}$")]
"""One chunk of a key expression."""

Count = Annotated[int, Field(strict=True, ge=0, lt=2**63)]
TimeNs = Annotated[int, Field(strict=True, ge=0, lt=2**63, description="nanoseconds")]
MAX_AGE_NS = 10**15
"""Largest age that is passed on [ns], 11.6 days: sums of ages neither overflow nor are refused."""
AgeNs = Annotated[int, Field(strict=True, ge=0, le=MAX_AGE_NS, description="nanoseconds")]
Real = Annotated[float, Field(strict=True, ge=-1e9, le=1e9)]
NonNegative = Annotated[float, Field(strict=True, ge=0.0, le=1e12)]
Fraction = Annotated[float, Field(strict=True, ge=0.0, le=1.0)]
Dimension = Annotated[int, Field(strict=True, ge=1, le=MAX_DIMENSION_PX, description="pixels")]
Flag = Annotated[bool, Field(strict=True)]
Text = Annotated[str, Field(strict=True, max_length=512)]
PersonId = Annotated[int, Field(strict=True, ge=1, lt=2**31)]
BoxXyxy = tuple[Real, Real, Real, Real]
"""Left, top, right, bottom in pixels of the published frame, origin top-left."""
Point = tuple[Real, Real]


class Part(BaseModel):
    """A frozen piece of a message; unknown keys are ignored so that newer senders can add some."""

    model_config = ConfigDict(
        frozen=True,
        extra="ignore",
        allow_inf_nan=False,
        ser_json_bytes="base64",
        val_json_bytes="base64",
    )


class Message(Part):
    """A message of its own on the wire.

    Subclasses set `schema_name` and `max_bytes`; `version` goes up when an old reader would
    misread a new message.
    """

    schema_name: ClassVar[str]
    version: ClassVar[int] = 1
    max_bytes: ClassVar[int] = 65536

    v: Annotated[int, Field(strict=True, ge=1, description="schema version")] = 1

    @classmethod
    def encoding(cls) -> str:
        """The Zenoh encoding string that marks this message on the wire."""
        return f"application/x-msgpack;{cls.schema_name}.v{cls.version}"
