"""Detectors that other packages add: found by the entry-point group `heel.detectors`.

An entry point names a class that is made with `DetectorSettings` and has `detect(frame)`. Where it
also has `Options`, a pydantic model, it is made with settings and options, which users set as
`[detector.options]`, `HEEL_DETECTOR__OPTIONS__NAME` or `--options NAME=VALUE,NAME=VALUE`.
"""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any

from pydantic import BaseModel, ValidationError

from heel.schemas.errors import SettingsError

GROUP = "heel.detectors"


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
