"""What a detector is: a class with `detect(frame) -> Blobs`, found by its name.

A package of one's own adds a detector by an entry point of the group `heel.detectors`, which names
a class that is made with `DetectorSettings`, see examples/red_detector.py. Where the class also has
`Options`, a pydantic model, it is made with settings and options, which users set as
`[detector.options]`, `HEEL_DETECTOR__OPTIONS__NAME` or `--options NAME=VALUE,NAME=VALUE`.

A detector that is to run as a process of its own needs nothing but `heel.schemas`, see
examples/own_detector.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from heel.schemas import Blobs, FrameId, Pointed, SettingsError, Tracks
from heel.services.detector.scene import SceneKey

GROUP = "heel.detectors"


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One frame and what goes with it.

    Attributes:
        id: which frame this is.
        image: (H, W, 3) uint8 BGR, any size from 1x1.
        source_size: width and height before capture scaled the frame, pixels.
        feedback: tracks of frame `seq - settings.feedback_lag_frames` or older, None when there
            are none; they may be of another scene.
        pointed: where a user pointed, since the frame before, at a person that is not tracked;
            None for nowhere. May be of another scene.
    """

    id: FrameId
    image: NDArray[np.uint8]
    source_size: tuple[int, int]
    feedback: Tracks | None
    pointed: Pointed | None = None

    @property
    def scene(self) -> SceneKey:
        """Which scene it shows."""
        height, width = self.image.shape[:2]
        return SceneKey(self.id.stream, self.id.epoch, width, height)


class FrameDetector(Protocol):
    """Finds people, or pieces of them, frame by frame; deterministic, without a clock."""

    def detect(self, frame: Frame) -> Blobs:
        """The blobs of one frame; a new stream, epoch or size starts over."""
        ...


@runtime_checkable
class KeepsState(Protocol):
    """A detector that another process can go on from; one of your own may be one."""

    def snapshot(self) -> bytes:
        """What the search rests on, for `restore`; 1 MiB at most."""
        ...

    def restore(self, snapshot: bytes) -> None:
        """Go on from a snapshot of a detector with the same settings.

        Raises:
            HeelError: it is none; nothing has changed then.
        """
        ...


def added_names() -> set[str]:
    """Names of the detectors that other packages add."""
    return {entry.name for entry in entry_points(group=GROUP)}


def added_detector(name: str) -> Any:
    """The class that another package has added under this name; None where there is none.

    Raises:
        SettingsError: it cannot be imported.
    """
    found = next((entry for entry in entry_points(group=GROUP) if entry.name == name), None)
    if found is None:
        return None
    try:
        return found.load()
    except (ImportError, AttributeError) as error:
        raise SettingsError(f"detector {name!r} ({found.value}): {error}") from error


def checked_options(name: str, given: dict[str, Any]) -> dict[str, Any]:
    """The options of a detector, those that were not given with their defaults.

    Raises:
        SettingsError: an unknown option, a value that is out of range, or no such detector.
    """
    model = getattr(added_detector(name), "Options", None)
    if model is None:
        if given:
            raise SettingsError(f"options: detector {name} has none: leave {', '.join(given)} out")
        return {}
    unknown = [option for option in given if option not in model.model_fields]
    if unknown:
        raise SettingsError(f"options.{unknown[0]}: detector {name} has {_described(model)}")
    try:
        checked: BaseModel = model.model_validate(given)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise SettingsError(
            f"options.{where} = {first.get('input')!r:.80}: {first['msg']}; detector {name} has "
            f"{_described(model)}"
        ) from None
    return checked.model_dump(mode="json")


def _described(model: type[BaseModel]) -> str:
    """The options of a model with their defaults and what they are."""
    return "; ".join(
        f"{name} [default: {field.default}]: {field.description}"
        for name, field in model.model_fields.items()
    )
