"""Settings of the recorder: what is kept, where, and how much of it."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from heel.services.runtime.settings import ServiceSettings

Frames = Literal["jpeg", "raw", "none"]


class RecorderSettings(ServiceSettings):
    """What passes on the bus goes to MCAP files, or to memory until something happens."""

    delivery: Literal["live"] = Field("live", description="a recorder holds nobody up")
    out: Path = Field(
        Path("recordings"), description="folder, or the name of a file that ends with .mcap"
    )
    frames: Frames = Field(
        "jpeg",
        description="as which pictures are kept; raw ones give the very same tracks again, and "
        "take 2 GB a minute (768x576, 25 a second)",
    )
    foxglove: bool = Field(
        True,
        description="besides keep pictures, marks, poses and a log in Foxglove's own types, so "
        "that its viewers show the file: without them JPEGs take half the room",
    )
    file_mb: int = Field(
        2000, ge=1, le=1_000_000, description="a new file is begun after so much, MB"
    )
    file_s: float = Field(600.0, ge=1, le=86400, description="a new file is begun after so long, s")
    spare_mb: int = Field(
        500, ge=0, le=1_000_000,
        description="recording pauses while less than this is free on the disk, MB",
    )  # fmt: skip
    last_s: float | None = Field(
        None, ge=1, le=3600,
        description="keep only the last seconds, in memory; a file is written at an emergency "
        "stop, when the follower is unsure, when its person comes into contact with another, and "
        "by `heel record --save`",
        json_schema_extra={"flag": "last"},
    )  # fmt: skip
    last_mb: int = Field(300, ge=1, le=100_000, description="most memory for the last seconds, MB")
