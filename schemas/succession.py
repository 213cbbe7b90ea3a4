"""What processes of one kind say to each other so that one can go on where another one ends."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from heel.schemas.base import Count, Message, Name
from heel.schemas.frame import FrameId, Producer

MAX_STATE_BYTES = 12 << 20
"""Of a state, below the 16 MiB that a router passes on: 128 people in sight and 64 remembered, with
five galleries each, are 12 MB."""


class Snapshot(Message):
    """All that the next answer of a process depends on. Reply on `cam/<cam>/snapshot/<service>`."""

    schema_name: ClassVar[str] = "snapshot"
    max_bytes: ClassVar[int] = MAX_STATE_BYTES + 4096

    service: Name = Field(description="kind of process")
    producer: Producer = Field(description="whose state it is")
    line: Producer = Field(description="the first of those that it has taken over from, or itself")
    turn: Count = Field(description="how often the line has been taken over")
    frame: FrameId = Field(description="the newest one that is in it")
    state: Annotated[bytes, Field(strict=True, max_length=MAX_STATE_BYTES)] = Field(
        description="for a process of the same version and settings; its form is Heel's own"
    )


class Handover(Message):
    """Payload of a query on `cam/<cam>/handover/<service>`: the one that works is to hand over."""

    schema_name: ClassVar[str] = "handover"
    max_bytes: ClassVar[int] = 512

    successor: Producer = Field(description="which of those that stand by is to go on")
