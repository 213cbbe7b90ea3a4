"""Settings of the tracker: the preset and the numbers of the default that can be overridden."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from heel.services.runtime.settings import ServiceSettings

Preset = Literal["default", "paper"]
Seconds = Annotated[float, Field(ge=0, le=60)]


class TrackerSettings(BaseModel):
    """Which tracker, and the default one's numbers.

    `preset="paper"` is the published method with its numbers as printed: all other fields then
    have no effect. A field given as None counts as not given. "Heights" are multiples of a
    person's own height in the picture; "gain" is 1 for a clean person who stands alone and 0 for
    one who explains nothing that others do not.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    preset: Preset = Field(default="default", description="paper: the published method as printed")
    min_height: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.10, description="lowest person that is shown, share of the image height"
    )
    acceleration: Annotated[float, Field(gt=0, le=100)] = Field(
        default=1.2, description="Kalman: standard deviation of acceleration, heights/s^2"
    )
    birth_gain: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.35, description="least gain of a new person"
    )
    duplicate_gain: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.15, description="below this gain a person may be another one's double"
    )
    min_in_view: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.25,
        description="share of a person that nobody nearer covers, below which nothing is measured",
    )
    show_missed_s: Seconds = Field(
        default=0.85,
        description="a person hidden by others is shown for this long, s; others for half of it",
    )
    forget_s: Seconds = Field(default=3.5, description="a person not seen is forgotten after this")

    identify: bool = Field(
        default=True,
        description="decide by looks who is who after people met, give up ids that stood for two "
        "people, and know people again who were lost",
    )
    calibration: Path | None = Field(
        default=None,
        description="file of `heel calibrate` or Town Centre's .ci: how the camera is mounted, "
        "from which the scene's scale is taken instead of learned",
    )

    @model_validator(mode="before")
    @classmethod
    def _none_is_not_given(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        return {name: value for name, value in data.items() if value is not None}


class TrackerServiceSettings(ServiceSettings, TrackerSettings):
    """Settings of the tracker process."""
