"""Settings of the tracker: which method, and which people are reported for how long."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from heel.schemas.errors import SettingsError
from heel.services.runtime.settings import ServiceSettings, StandbySettings

Preset = Literal["default", "paper"]
Seconds = Annotated[float, Field(ge=0, le=60)]
Input = Literal["foreground", "people", "pointed-at"]
"""What a tracker works on: foreground regions, people's boxes of a network or the simulator, or the
one person that a user pointed at and the detector looks for."""


@dataclass(frozen=True, slots=True)
class Reporting:
    """What of its people a tracker reports on one kind of input.

    Attributes:
        min_height: lowest person that is shown, share of the image height.
        show_missed_s: time unseen for which a person is shown.
        forget_s: time unseen for which a person is tracked at all.
    """

    min_height: float
    show_missed_s: float
    forget_s: float


_DEFAULTS: dict[Input, Reporting] = {
    "foreground": Reporting(min_height=0.10, show_missed_s=0.85, forget_s=3.5),
    "people": Reporting(min_height=0.0, show_missed_s=0.15, forget_s=2.0),
    "pointed-at": Reporting(min_height=0.0, show_missed_s=0.0, forget_s=1.0),
}
"""Foreground breaks up for long behind things and people, boxes of a network seldom do, and what
the detector itself looks for it finds anew; chosen by hand."""


class TrackerSettings(BaseModel):
    """Which tracker, and what it reports; what is not given depends on the kind of input.

    `preset="paper"` is the published method with its numbers as printed: it takes none of the
    others, and foreground regions alone. A field given as None counts as not given.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    preset: Preset = Field(
        default="default",
        description="default: ours; paper: the published method as printed, on foreground only",
    )
    min_height: Annotated[float, Field(gt=0, le=1)] | None = Field(
        default=None,
        description="lowest person that is shown, share of the image height: lower shows people "
        "farther away and more clutter [0.10 on foreground; without bound on people's boxes]",
    )
    show_missed_s: Seconds | None = Field(
        default=None,
        description="a person not seen is shown for this long, s: more bridges gaps and leaves "
        "boxes behind; on foreground half of it unless others hide the person "
        "[0.85 on foreground, 0.15 on people's boxes, 0 for one pointed at]",
    )
    forget_s: Seconds | None = Field(
        default=None,
        description="a person not seen keeps a place and takes what appears there for this long, "
        "s: more bridges longer gaps and risks taking another for the person "
        "[3.5 on foreground, 2 on people's boxes, 1 for one pointed at]",
    )
    identify: bool = Field(
        default=True,
        description="decide by appearance which person is which after people met, and know people "
        "again who were forgotten; without it those get new ids",
    )
    calibration: Path | None = Field(
        default=None,
        description="on foreground: file of `heel calibrate person` or Town Centre's .ci: how the "
        "camera is mounted, from which the scene's scale is taken instead of learned",
    )

    @model_validator(mode="before")
    @classmethod
    def _none_is_not_given(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        return {name: value for name, value in data.items() if value is not None}

    @model_validator(mode="after")
    def _paper_is_as_printed(self) -> TrackerSettings:
        given = sorted(self.model_fields_set & set(TrackerSettings.model_fields) - {"preset"})
        if self.preset == "paper" and any(self._differs(name) for name in given):
            name = next(name for name in given if self._differs(name))
            raise ValueError(
                f"{name} = {getattr(self, name)}: preset paper has its numbers as printed: leave "
                f"out {name}, or choose preset default"
            )
        return self

    def _differs(self, name: str) -> bool:
        return bool(getattr(self, name) != TrackerSettings.model_fields[name].default)

    def reporting(self, kind: Input) -> Reporting:
        """What is reported on one kind of input.

        Raises:
            SettingsError: a setting has no meaning for that input.
        """
        self.check(kind)
        usual = _DEFAULTS[kind]
        return Reporting(
            usual.min_height if self.min_height is None else self.min_height,
            usual.show_missed_s if self.show_missed_s is None else self.show_missed_s,
            usual.forget_s if self.forget_s is None else self.forget_s,
        )

    def check(self, kind: Input) -> None:
        """Refuse what a kind of input cannot follow.

        Raises:
            SettingsError: a setting has no meaning for that input.
        """
        if kind == "foreground":
            return
        boxes = "people's boxes" if kind == "people" else "a person who was pointed at"
        if self.preset == "paper":
            raise SettingsError(
                f"tracker.preset = paper: the published method tracks foreground, and the detector "
                f"sends {boxes}: choose preset default, or detector mog2"
            )
        if self.calibration is not None and kind == "people":
            raise SettingsError(
                f"tracker.calibration = {self.calibration}: it gives the scale of foreground, and "
                f"the detector sends {boxes}, which have one: leave it out"
            )


class TrackerServiceSettings(ServiceSettings, StandbySettings, TrackerSettings):
    """Settings of the tracker process."""

    trace: Path | None = Field(
        default=None,
        description="file to which every decision about an identity is written as it falls, up to "
        "64 MiB; `heel why` tells it in sentences",
    )
