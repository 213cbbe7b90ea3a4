"""Settings of the detector: the two presets and every number that can be overridden."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from heel.services.runtime.settings import ServiceSettings

Preset = Literal["default", "paper"]

# The paper's own numbers, which nothing overrides, are in `mog2/numbers.py`.
_PAPER: dict[str, Any] = {
    "detector": "mog2",
    "work_width_px": 768,
    "blur_px": 0,
    "shadow_ratio": 0.5,
    "protect": False,
}


class DetectorSettings(BaseModel):
    """A preset and what is changed in it.

    Field defaults are those of the preset `default`; `preset="paper"` replaces those that are
    not given. A field given as None counts as not given.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    preset: Preset = Field(default="default", description="paper: the published method as printed")
    detector: Annotated[str, Field(pattern=r"^[a-z0-9_-]{1,64}$")] = Field(
        default="auto",
        description="mixture: background that learns around people; ego: carried along with a "
        "moving camera; auto: whichever of the two holds, or the model where one is given; onnx: "
        "the model; mog2: OpenCV's background; or one that another package adds",
    )
    model: Path | None = Field(
        default=None, description="network that finds people, an ONNX file (onnx, auto)"
    )
    model_class: Annotated[int, Field(ge=0, le=100_000)] | None = Field(
        default=None,
        description="onnx: number of the class that is a person, from 0, for a file that does not "
        "name its classes",
    )
    model_score: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.3, description="onnx: least score of a person"
    )
    model_budget_ms: Annotated[float, Field(ge=0, le=10000)] = Field(
        default=0.0,
        description="onnx, live: mean time of the network a frame that is kept, ms; 0: no bound, "
        "as always in a lossless run",
    )
    model_closer_looks: Annotated[int, Field(ge=0, le=8)] = Field(
        default=2,
        description="onnx: most parts of a frame on which the network runs again, enlarged, where "
        "people are small",
    )
    carry_s: Annotated[float, Field(ge=0, le=5)] = Field(
        default=0.2,
        description="onnx: longest time for which somebody the network misses is carried on by "
        "their pixels, s",
    )
    work_width_px: Annotated[int, Field(ge=16, le=1024)] = Field(
        default=480, description="frames wider than this are shrunk before anything else, pixels"
    )
    blur_px: Annotated[int, Field(ge=0, le=31)] = Field(
        default=5, description="Gaussian blur before the background model, 0 or odd, working pixels"
    )
    shadow_ratio: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.7, description="darkest share of the background still called shadow (MOG2's tau)"
    )
    foreground_sigmas: Annotated[float, Field(ge=1, le=30)] = Field(
        default=3.2,
        description="mixture: distance from the background that is foreground, standard deviations",
    )
    carried_sigmas: Annotated[float, Field(ge=1, le=30)] = Field(
        default=3.0, description="ego: the same, for the background that moves with the camera"
    )
    learning_rate_per_s: Annotated[float, Field(gt=0, le=10)] = Field(
        default=0.14, description="mixture: how fast the background follows the picture, 1/s"
    )
    startup_s: Annotated[float, Field(ge=0, le=60)] = Field(
        default=4.0,
        description="mixture: what has not been still for a moment by then is background, seconds",
    )
    dissolve_ghosts: bool = Field(
        default=True, description="mixture: learn at once where a learned person has walked away"
    )
    min_blob_area_px: Annotated[int, Field(ge=1, le=10000)] = Field(
        default=12, description="mixture: least foreground pixels of a blob, working pixels"
    )
    protect: bool = Field(
        default=True, description="keep confirmed people out of the background model"
    )
    feedback_lag_frames: Annotated[int, Field(ge=1, le=50)] = Field(
        default=2, description="at frame n the tracks of frame n minus this are used"
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_from_preset(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        given = {name: value for name, value in data.items() if value is not None}
        return {**_PAPER, **given} if given.get("preset") == "paper" else given

    @property
    def sends_people(self) -> bool:
        """Whether it is known before the first frame that people's boxes are sent, not regions."""
        return self.detector == "onnx" or (self.detector == "auto" and self.model is not None)

    @model_validator(mode="after")
    def _blur_is_odd(self) -> DetectorSettings:
        if self.blur_px and self.blur_px % 2 == 0:
            raise ValueError(f"blur_px {self.blur_px} is even: use 0 or an odd size")
        return self


class DetectorServiceSettings(ServiceSettings, DetectorSettings):
    """Settings of the detector process."""

    feedback_timeout_s: float = Field(
        default=2.0,
        ge=0,
        le=60,
        description="lossless: longest wait for the tracks of an earlier frame, seconds",
    )
