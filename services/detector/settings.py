"""Settings of the detector: two presets, what can be changed, and which method reads what."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from heel.schemas.errors import SettingsError
from heel.services.detector.interface import checked_options
from heel.services.models.store import ModelFile, with_network_there
from heel.services.networks.names import EngineName, HeadName
from heel.services.runtime.settings import ServiceSettings, StandbySettings, split_list

Preset = Literal["default", "paper"]
Method = Literal["auto", "mixture", "ego", "mog2", "onnx"]
BUILT_IN: tuple[str, ...] = get_args(Method)

# The paper's other numbers, which nothing overrides, are in `mog2.py`.
_PAPER: dict[str, Any] = {
    "detector": "mog2",
    "work_width_px": 768,
    "blur_px": 0,
    "protect": False,
}
NO_NETWORK = (
    "no network: without one people are found by what moves, or one alone that is pointed at; with "
    "one everybody is seen at once, also by a robot that drives: heel models get yolox-nano "
    "(--model none: go on without)"
)
_LEARNED = ("auto", "mixture", "ego")
_USED_BY: dict[str, tuple[str, ...]] = {
    "model": ("onnx",),
    "model_near": ("onnx",),
    "model_class": ("onnx",),
    "model_head": ("onnx",),
    "model_engine": ("onnx",),
    "model_providers": ("onnx",),
    "model_threads": ("onnx",),
    "model_score": ("onnx",),
    "model_budget_ms": ("onnx",),
    "model_closer_looks": ("onnx",),
    "bridge_s": ("onnx",),
    "startup_s": ("auto", "mixture"),
    "dissolve_ghosts": _LEARNED,
    "min_blob_area_px": _LEARNED,
    "protect": _LEARNED,
    "feedback_lag_frames": (*_LEARNED, "onnx"),
    "options": (),
}
"""Settings that not every built-in method reads, and those that do."""


def _split_options(value: object) -> object:
    """Let `NAME=VALUE,NAME=VALUE` stand for a table, as people type it in shells."""
    if not isinstance(value, str):
        return value
    pairs = [part.partition("=") for part in value.split(",") if part.strip()]
    for name, given, _ in pairs:
        if not given:
            raise SettingsError(f"options {name!r}: write NAME=VALUE, several with commas between")
    return {name.strip(): text.strip() for name, _, text in pairs}


class DetectorSettings(BaseModel):
    """A preset and what is changed in it.

    Field defaults are those of the preset `default`; `preset="paper"` replaces those that are
    not given. A field given as None counts as not given. A setting that the chosen method does not
    read is an error.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    preset: Preset = Field(default="default", description="paper: the published method as printed")
    detector: Annotated[str, Field(pattern=r"^[a-z0-9_-]{1,64}$")] = Field(
        default="auto",
        description="mixture: background of a standing camera; ego: background warped with a "
        "moving one; auto: whichever of the two holds, or the model where one is given; onnx: "
        "the model; mog2: OpenCV's background; or one that another package adds",
    )
    options: Annotated[dict[str, Any], BeforeValidator(_split_options)] = Field(
        default_factory=dict,
        description="settings of a detector that another package adds, NAME=VALUE,...; an unknown "
        "name gets the list",
    )
    model: ModelFile = Field(
        default=None,
        description="network that finds people (onnx, auto): a name of `heel models list`, an ONNX "
        "file, or none; not given, one that `heel models get` has brought is used",
    )
    model_near: ModelFile = Field(
        default=None,
        description="onnx: a second, smaller network that looks at every frame and closer at the "
        "people in it, a name or a file; the model itself then sees a whole frame about eight "
        "times a second",
    )
    model_class: Annotated[int, Field(ge=0, le=100_000)] | None = Field(
        default=None,
        description="onnx: number of the class that is a person, from 0, for a file that does not "
        "name its classes",
    )
    model_head: HeadName | None = Field(
        default=None,
        description="onnx: what the output of the network means, for a file of which nothing tells "
        "it; messages name those that it can be",
    )
    model_engine: EngineName = Field(
        default="auto",
        description="onnx: what runs the network: onnxruntime, opencv, which takes twice as long, "
        "or auto: onnxruntime where it is installed",
    )
    model_providers: Annotated[tuple[str, ...], BeforeValidator(split_list)] = Field(
        default=(),
        description="onnx: execution providers of onnxruntime for an NPU or a GPU, as it names "
        "them, before the processor; results are then those of that hardware",
    )
    model_threads: Annotated[int, Field(ge=1, le=64)] = Field(
        default=1,
        description="onnx: threads of onnxruntime; more shortens a frame and takes cores from the "
        "other services, with more processor time in all",
    )
    model_score: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.3,
        description="onnx: least score of a person; lower finds more people and more that are none",
    )
    model_budget_ms: Annotated[float, Field(ge=0, le=10000)] = Field(
        default=0.0,
        description="onnx, live: mean time of the network a frame that is kept, ms; less looks at "
        "fewer frames; 0: no bound, as always in a lossless run",
    )
    model_closer_looks: Annotated[int, Field(ge=0, le=8)] | None = Field(
        default=None,
        description="onnx: most parts of a frame on which the network runs again, enlarged; more "
        "finds small people sooner and takes longer [default: 2 for an input of 416x416 pixels, 8 "
        "for one of 192x192, by their number; with model_near at most 3]",
    )
    bridge_s: Annotated[float, Field(ge=0, le=5)] = Field(
        default=0.2,
        description="onnx: longest time for which a person that the network misses is kept by its "
        "optical flow, s; longer bridges more gaps and keeps more false boxes",
    )
    work_width_px: Annotated[int, Field(ge=16, le=1024)] = Field(
        default=480,
        description="frames wider than this are shrunk before anything else, pixels; more sees "
        "smaller people and takes longer",
    )
    blur_px: Annotated[int, Field(ge=0, le=31)] = Field(
        default=5,
        description="Gaussian blur before the background model, 0 or odd, working pixels; more "
        "hides noise and small people",
    )
    startup_s: Annotated[float, Field(ge=0, le=60)] = Field(
        default=4.0,
        description="mixture: what has not been still for a moment by then is background, seconds; "
        "longer waits for people who move about in the first frames",
    )
    dissolve_ghosts: bool = Field(
        default=True,
        description="mixture, ego: learn at once where a person that was background has left",
    )
    min_blob_area_px: Annotated[int, Field(ge=1, le=10000)] = Field(
        default=12,
        description="mixture, ego: least foreground pixels of a blob, working pixels; more hides "
        "noise and distant people",
    )
    protect: bool = Field(
        default=True, description="keep confirmed people out of the background model"
    )
    feedback_lag_frames: Annotated[int, Field(ge=1, le=50)] = Field(
        default=2,
        description="at frame n the tracks of frame n minus this are used; more lets detector and "
        "tracker work side by side, on older tracks",
    )

    @property
    def method(self) -> str:
        """What detects: one of `Method`, or the name of a detector that another package adds."""
        return "onnx" if self.detector == "auto" and self.model is not None else self.detector

    @model_validator(mode="before")
    @classmethod
    def _fill_from_preset(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        given = _as_given(data)
        name, options = given.get("detector"), _split_options(given.get("options", {}))
        if isinstance(name, str) and name not in BUILT_IN and isinstance(options, Mapping):
            given["options"] = checked_options(name, dict(options))
        return given

    @property
    def sends_people(self) -> bool:
        """Whether it is known before the first frame that people's boxes are sent, not regions."""
        return self.method == "onnx"

    @model_validator(mode="after")
    def _blur_is_odd(self) -> DetectorSettings:
        if self.blur_px and self.blur_px % 2 == 0:
            raise ValueError(f"blur_px {self.blur_px} is even: use 0 or an odd size")
        return self

    @model_validator(mode="after")
    def _method_reads_them(self) -> DetectorSettings:
        if self.method not in BUILT_IN:
            return self
        preset = _PAPER if self.preset == "paper" else {}
        for name, users in _USED_BY.items():
            value, field = getattr(self, name), type(self).model_fields[name]
            usual = preset.get(name, field.get_default(call_default_factory=True))
            if value != usual and self.method not in users:
                of = f"detector {' or '.join(users)}" if users else "detectors of other packages"
                other = "--model none" if self.method != self.detector else "another detector"
                raise SettingsError(
                    f"{name}: detector {self.method} does not read it, it is for {of}: leave it "
                    f"out, or choose {other}"
                )
        return self

    @property
    def hint(self) -> str | None:
        """For a user that has no network and did not say so: what one gives, and how to get it."""
        if self.method != "auto" or "model" in self.model_fields_set:
            return None
        return NO_NETWORK


def _as_given(data: Mapping[str, Any]) -> dict[str, Any]:
    """What is given, with what the preset says of the rest."""
    given = {name: value for name, value in data.items() if value is not None}
    return {**_PAPER, **given} if given.get("preset") == "paper" else given


def with_network(data: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a detector, by name, with the network that is there where they allow for it.

    Raises:
        SettingsError: it is there and damaged.
    """
    given = _as_given(data)
    return with_network_there(given, given.get("detector", "auto"))


class NamedDetectorSettings(ServiceSettings, StandbySettings, DetectorSettings):
    """Settings of the detector process with a network only if one is named, for what is scored."""


class DetectorServiceSettings(NamedDetectorSettings):
    """Settings of the detector process, which takes the network that is there."""

    @model_validator(mode="before")
    @classmethod
    def _take_the_network_there(cls, data: Any) -> Any:
        return with_network(data) if isinstance(data, dict) else data
