"""What can be chosen about a drawn scene, in Python or after the `?` of `scene:NAME?...`."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

SceneName = Literal["demo", "crossing", "pacing", "empty"]


class SceneSettings(BaseModel):
    """Every choice; unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    name: SceneName = Field(default="demo", description="choreography")
    seed: int = Field(default=1, ge=0, lt=2**32, description="clothes, texture and noise")
    people: int | None = Field(
        default=None, ge=0, le=24, description="people; the scene's own number if not given"
    )
    frames: int | None = Field(
        default=None, ge=1, le=1_000_000, description="length; one pass of the scene if not given"
    )
    fps: float = Field(default=25.0, gt=0, le=240, description="frames per second")
    width: int = Field(default=640, ge=64, le=3840, description="pixels")
    height: int = Field(default=480, ge=48, le=2160, description="pixels")
    noise: float = Field(
        default=2.5, ge=0, le=20, description="standard deviation of the sensor noise, 8-bit levels"
    )
    shadows: bool = Field(default=True, description="whether people cast shadows, as under the sun")
