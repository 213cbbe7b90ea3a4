"""Settings of the simulator: which episode, which camera, and how people are seen."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from heel.services.runtime.settings import ServiceSettings
from heel.services.simulator.state import CameraMount

Perception = Literal["pixels", "simulated-boxes"]
_MOUNT = CameraMount()


class SimulatorSettings(ServiceSettings):
    """A world with people, and a robot whose camera moves when it is told to."""

    delivery: Literal["live"] = Field("live", description="a world does not wait")
    scenario: str = Field(
        "distractor-3", description="kind of episode", json_schema_extra={"positional": True}
    )
    seed: int = Field(1, ge=0, lt=2**31, description="of the episode; each is another one")
    perception: Perception = Field(
        "pixels",
        description="pixels: a detector is to find people in the picture; simulated-boxes: the "
        "simulator itself says where people are, with a detector's errors, and no detector runs",
    )
    loop: bool = Field(False, description="go on with the next seed when an episode is over")
    truth: Path | None = Field(
        None, description="file for the truth of every frame, JSON lines; the stack never reads it"
    )
    pictures: bool = Field(
        True, description="draw what the camera sees (extra sim); needed by perception pixels"
    )
    depth: bool = Field(
        False,
        description="the camera measures depth, too; free distances then are those of the depth "
        "picture, ahead only, instead of a ring of range sensors",
    )
    jpeg_quality: int = Field(
        90, ge=1, le=100, description="quality of the JPEGs that go to other hosts, percent"
    )
    width_px: int = Field(_MOUNT.width_px, ge=64, le=1920, description="of the picture")
    height_px: int = Field(_MOUNT.height_px, ge=64, le=1200, description="of the picture")
    fps: float = Field(_MOUNT.fps, ge=1, le=60, description="pictures per second")
    horizontal_fov_deg: float = Field(
        90.0, ge=20, le=140, description="horizontal field of view of the camera, degrees"
    )
    mount_height_m: float = Field(
        _MOUNT.height_m, ge=0.1, le=2.5, description="camera above ground, m"
    )
    mount_pitch_deg: float = Field(
        0.0, ge=-45, le=45, description="camera pitch, degrees, down is positive"
    )

    @model_validator(mode="after")
    def _somebody_sees(self) -> Self:
        if self.perception == "pixels" and not self.pictures:
            raise ValueError(
                "without pictures nobody can see people in pixels: leave out --no-pictures, or say "
                "--perception simulated-boxes"
            )
        if self.depth and not self.pictures:
            raise ValueError("depth is drawn, too: leave out --no-pictures, or --depth")
        return self

    def mount(self) -> CameraMount:
        """The camera as the world knows it."""
        return CameraMount(
            self.width_px, self.height_px, self.fps, math.radians(self.horizontal_fov_deg),
            self.mount_height_m, math.radians(self.mount_pitch_deg),
        )  # fmt: skip
