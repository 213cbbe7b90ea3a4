"""Settings of the tracker: the two presets and every number that can be overridden."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from services.runtime.settings import ServiceSettings

Preset = Literal["default", "paper"]
Share = Annotated[float, Field(ge=0, le=1)]
Seconds = Annotated[float, Field(ge=0, le=60)]

_PAPER: dict[str, Any] = {
    "proximity_weight": 0.0,
    "proximity_reach": 1.0,
    "min_score": 0.0,
    "occlusion_test": "printed",
    "features": "paper",
    "fit_groups_to_evidence": False,
    "join_fragments": False,
    "partial_height_ratio": 0.0,
    "confirm_hits": 3,
    "min_travel": 0.0,
}


class TrackerSettings(BaseModel):
    """A preset and what is changed in it.

    Field defaults are those of the preset `default`; `preset="paper"` replaces those that are
    not given. A field given as None counts as not given. Lengths marked "heights" are multiples
    of the person's own height in the picture.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    preset: Preset = Field(default="default", description="paper: the published method as printed")

    acceleration: Annotated[float, Field(gt=0, le=100)] = Field(
        default=1.2, description="Kalman: standard deviation of acceleration, heights/s^2"
    )
    growth: Annotated[float, Field(gt=0, le=10)] = Field(
        default=0.25, description="Kalman: deviation of relative growth of area and span, 1/s^2"
    )
    position_noise: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.05, description="Kalman: deviation of a measured centre, heights"
    )
    size_noise: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.15, description="Kalman: deviation of measured area and span, share"
    )
    coasting_friction: Annotated[float, Field(ge=0, le=10)] = Field(
        default=0.35, description="velocity decays at this rate while nobody is seen, 1/s"
    )

    proximity_weight: Share = Field(
        default=0.5, description="matching score: share of nearness, the rest is IoU"
    )
    proximity_reach: Annotated[float, Field(gt=0, le=10)] = Field(
        default=0.6, description="matching score: distance at which nearness is 0, heights"
    )
    min_score: Share = Field(default=0.1, description="pairs at or below this are never matched")

    occlusion_test: Literal["printed", "local"] = Field(
        default="local",
        description="printed: fewer blobs, a larger one and eq. 4; local: the person left out "
        "lies under a larger blob",
    )
    aspect_ratio: Annotated[float, Field(gt=0, le=10)] = Field(
        default=0.5, description="occlusion test, eq. 4: s^2 / A above this"
    )
    min_cover: Share = Field(
        default=0.5, description="share of a person's box under a blob that hides that person"
    )
    max_group: Annotated[int, Field(ge=2, le=32)] = Field(
        default=8, description="most people in one blob"
    )
    min_part_height: Share = Field(
        default=0.5, description="split: smaller parts are fragments, share of the mean height"
    )
    fit_groups_to_evidence: bool = Field(
        default=True, description="place people within their common blob by its foreground pixels"
    )
    join_fragments: bool = Field(
        default=True, description="unite the pieces of a person cut by a pole"
    )
    partial_height_ratio: Share = Field(
        default=0.6, description="blobs lower than this share of the person show only a part of it"
    )

    features: Literal["paper", "paper+colour"] = Field(
        default="paper+colour", description="what identities are compared by at a split"
    )
    colour_weight: Annotated[float, Field(ge=0, le=100)] = Field(
        default=7.0, description="weight of the colour histogram; each family of the paper has 1"
    )
    reference_memory_s: Seconds = Field(
        default=2.0, description="time constant of a person's reference features"
    )
    identity_sharpness: Annotated[float, Field(gt=0, le=1000)] = Field(
        default=20.0, description="softmax over relative cost differences of assignments"
    )
    doubt_s: Annotated[float, Field(gt=0, le=3600)] = Field(
        default=4.0, description="identity confidence falls to 1/e in this time while coasting"
    )
    trust_s: Annotated[float, Field(gt=0, le=3600)] = Field(
        default=1.0, description="and comes back with this time constant when seen alone"
    )

    confirm_hits: Annotated[int, Field(ge=1, le=100)] = Field(
        default=5, description="frames seen before a person counts"
    )
    min_travel: Annotated[float, Field(ge=0, le=10)] = Field(
        default=0.4, description="way moved before a person counts, heights; ghosts never move"
    )
    show_missed_s: Seconds = Field(
        default=0.5, description="a person not seen is shown for this long"
    )
    forget_s: Seconds = Field(default=3.0, description="and forgotten after this")

    @model_validator(mode="before")
    @classmethod
    def _fill_from_preset(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        given = {name: value for name, value in data.items() if value is not None}
        return {**_PAPER, **given} if given.get("preset") == "paper" else given


class TrackerServiceSettings(ServiceSettings, TrackerSettings):
    """Settings of the tracker process."""
