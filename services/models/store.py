"""Where the networks are kept, which are there, and which file a setting means."""

from __future__ import annotations

import difflib
import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import platformdirs
from pydantic import BeforeValidator

from heel.schemas.errors import SettingsError
from heel.services.models.catalogue import KNOWN, KnownModel

VARIABLE = "HEEL_MODELS"
"""Names another folder: a container's volume, a robot's data partition, an empty one for tests."""
NONE = "none"
"""In place of a name: no network, also where one is there."""


def models_folder() -> Path:
    """`$HEEL_MODELS`, else `heel/models` in the user's cache; it need not exist."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named).expanduser().absolute()
    return platformdirs.user_cache_path("heel") / "models"


def place_of(model: KnownModel) -> Path:
    """The file of a network, whether it is there or not."""
    return models_folder() / model.file


def is_there(model: KnownModel) -> bool:
    """Whether its file is there, in whatever state."""
    return os.path.isfile(place_of(model))


def known_model(name: str) -> KnownModel:
    """The network of that name.

    Raises:
        SettingsError: there is none.
    """
    if name in KNOWN:
        return KNOWN[name]
    close = difflib.get_close_matches(name, KNOWN, n=1)
    raise SettingsError(
        f"no model {name!r}"
        + (f"; did you mean {close[0]!r}?" if close else f"; known: {', '.join(KNOWN)}")
    )


def sha256_of(file: Path) -> str:
    """Of a file's content, hexadecimal.

    Raises:
        OSError: it cannot be read.
    """
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def damage(model: KnownModel) -> str | None:
    """What is wrong with the file that is there, in a few words; None if it is whole."""
    file = place_of(model)
    try:
        size = file.stat().st_size
        if size != model.size_bytes:
            return f"{size} bytes in place of {model.size_bytes}"
        found = sha256_of(file)
    except OSError as error:
        return f"cannot be read ({error.strerror})"
    return None if found == model.sha256 else f"sha256 {found[:12]}... is another file's"


def whole_file(model: KnownModel) -> Path:
    """The file of a network that is there and whole: it is looked at each time it is asked for.

    Raises:
        SettingsError: it is not there, or damaged.
    """
    file = place_of(model)
    if not is_there(model):
        raise SettingsError(
            f"model {model.name} is not in {models_folder()}: `heel models get {model.name}`, or "
            "give a file"
        )
    if (what := damage(model)) is not None:
        raise SettingsError(
            f"model {model.name}, {file}: {what}: `heel models get {model.name}` brings it anew"
        )
    return file


def file_meant(value: Any) -> Any:
    """What a setting that names a network means: a file, or None for no network.

    A text that is a known name means that network; `none` means none; any other text is a path, and
    so is every `Path`, also one that looks like a name.

    Raises:
        SettingsError: a name that is not known, or a network that is not there or no detector.
    """
    if not isinstance(value, str):
        return value
    if value == NONE:
        return None
    if value in KNOWN:
        model = KNOWN[value]
        if model.kind != "people":
            raise SettingsError(f"model {value} finds no people: it is for {model.good_for}")
        return whole_file(model)
    if value and not any(mark in value for mark in "./\\~") and not os.path.exists(value):
        known_model(value)
    return Path(value)


ModelFile = Annotated[Path | None, BeforeValidator(file_meant)]
"""Type of a setting that takes a known name, a file, or `none`."""


def first_there() -> KnownModel | None:
    """The first known network that finds people and is there."""
    return next((one for one in KNOWN.values() if one.kind == "people" and is_there(one)), None)


def with_network_there(given: Mapping[str, Any], method: str) -> dict[str, Any]:
    """Settings of a detector with the network that is there, where they do not speak of one.

    Args:
        given: what a user has set, by name.
        method: the detector that this asks for; only `auto` and `onnx` use a network.

    Raises:
        SettingsError: the network that is there is damaged.
    """
    wanted = method in ("auto", "onnx") and given.get("model") is None
    model = first_there() if wanted else None
    return dict(given) if model is None else {**given, "model": whole_file(model)}


def identified(file: Path) -> tuple[str | None, str]:
    """The name that the content of a file is known by, None for any other, and its sha256.

    Raises:
        OSError: it cannot be read.
    """
    digest = sha256_of(file)
    return next((one.name for one in KNOWN.values() if one.sha256 == digest), None), digest
