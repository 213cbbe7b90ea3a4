"""Settings of the detector: the two presets and every number that can be overridden."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from services.runtime.settings import ServiceSettings

Preset = Literal["default", "paper"]
KernelSize = Annotated[int, Field(ge=0, le=31)]

# As printed where the paper prints a number (tau, eq. 3; full 768x576 frames); OpenCV's own
# defaults for MOG2 where it does not.
_PAPER: dict[str, Any] = {
    "work_width_px": 768,
    "blur_px": 0,
    "variance_threshold": 16.0,
    "median_px": 0,
    "shadow_ratio": 0.5,
    "shadow_fill_fraction": 0.0,
    "open_width_px": 3,
    "open_height_px": 3,
    "close_width_px": 5,
    "close_height_px": 5,
    "min_box_area_fraction": 0.01,
    "min_height_fraction": 0.0,
    "min_fill": 0.0,
    "protect": False,
}


class DetectorSettings(BaseModel):
    """A preset and what is changed in it.

    Field defaults are those of the preset `default`; `preset="paper"` replaces those that are
    not given. A field given as None counts as not given.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    preset: Preset = Field(default="default", description="paper: the published method as printed")
    work_width_px: Annotated[int, Field(ge=16, le=1024)] = Field(
        default=480, description="frames wider than this are shrunk before anything else, pixels"
    )
    blur_px: KernelSize = Field(
        default=5, description="Gaussian blur before the background model, 0 or odd, working pixels"
    )
    history_frames: Annotated[int, Field(ge=1, le=100000)] = Field(
        default=500, description="memory of the background model, frames"
    )
    variance_threshold: Annotated[float, Field(ge=1, le=1000)] = Field(
        default=16.0, description="squared Mahalanobis distance that makes a pixel foreground"
    )
    shadow_ratio: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.7, description="darkest share of the background still called shadow (MOG2's tau)"
    )
    shadow_fill_fraction: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.04,
        description="shadow between foreground above and below is a person again, up to this share "
        "of the frame height; 0: never",
    )
    median_px: Literal[0, 3, 5] = Field(
        default=5, description="median filter over the pixel labels, working pixels, 0: none"
    )
    open_width_px: KernelSize = Field(default=0, description="opening, working pixels, 0: none")
    open_height_px: KernelSize = Field(default=0, description="opening, working pixels, 0: none")
    close_width_px: KernelSize = Field(default=3, description="closing, working pixels, 0: none")
    close_height_px: KernelSize = Field(default=9, description="closing, working pixels, 0: none")
    min_box_area_fraction: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0012, description="true-blob test: box area over frame area; the paper has 1/100"
    )
    min_height_fraction: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.07, description="true-blob test: box height over frame height"
    )
    min_fill: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.2, description="true-blob test: foreground pixels over box area"
    )
    protect: bool = Field(
        default=True, description="keep confirmed people out of the background model"
    )
    protect_margin: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.15, description="protected boxes grow by this share of their size on each side"
    )
    protect_still_s: Annotated[float, Field(ge=0, le=3600)] = Field(
        default=10.0, description="a track on one spot for longer is learned after all, seconds"
    )
    feedback_lag_frames: Annotated[int, Field(ge=1, le=50)] = Field(
        default=2, description="frame n is protected with the tracks of frame n minus this"
    )
    learning_frames: Annotated[int, Field(ge=0, le=10000)] = Field(
        default=25, description="frames after a start during which the background is not believed"
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_from_preset(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        given = {name: value for name, value in data.items() if value is not None}
        return {**_PAPER, **given} if given.get("preset") == "paper" else given

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
