"""Driving by hand: who asks for it, who has it, and what the hand wishes at this moment."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from heel.schemas.base import Count, Flag, Message

LONGEST_HOLD_S = 0.5
"""Most seconds that a wish holds: as long as a command of the follower's, by default."""
Share = Annotated[float, Field(strict=True, ge=-1, le=1)]
Grant = Annotated[str, Field(strict=True, pattern=r"^[0-9a-f]{16}$")]
Words = Annotated[str, Field(strict=True, max_length=96)]


class Manual(Message):
    """What a hand wishes, several times a second while the dead man's switch is held.

    It holds for `ttl_s` from its arrival, less the age in its stamp. Never cached, never latched.
    """

    schema_name: ClassVar[str] = "manual"
    max_bytes: ClassVar[int] = 512

    grant: Grant = Field(description="as the follower gave it: wishes with another one do nothing")
    seq: Count = Field(description="goes up by one with each wish of a grant")
    held: Flag = Field(description="whether the dead man's switch is held; false: stand, at once")
    forward: Share = Field(
        description="of the greatest speed of driving by hand; ahead is positive"
    )
    left: Share = Field(description="of the greatest turn rate; left is positive")
    ttl_s: Annotated[float, Field(strict=True, gt=0, le=LONGEST_HOLD_S)] = Field(
        description="the robot stands this long after the last wish"
    )


class ManualRequest(Message):
    """Payload of a query on `follow/manual`."""

    schema_name: ClassVar[str] = "manual-request"
    max_bytes: ClassVar[int] = 512

    take: Flag = Field(description="true: drive by hand; false: hand back to following")
    source: Words = Field(description="who asks, in words")


class ManualGrant(Message):
    """Reply of `follow/manual`."""

    schema_name: ClassVar[str] = "manual-grant"
    max_bytes: ClassVar[int] = 512

    grant: Grant | None = Field(
        default=None, description="to be repeated in each wish; none: the follower drives"
    )
    source: Words = Field(default="", description="who drives by hand, in words")
