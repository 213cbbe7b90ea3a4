"""Which of a network's classes are people."""

from __future__ import annotations

import re
from dataclasses import dataclass

from heel.schemas.errors import SettingsError

_PEOPLE = {"person", "persons", "people", "pedestrian", "pedestrians", "human", "humans"}
_NO_NAME = re.compile(r"(class|cls|c|label|object|item)?[ _-]?\d+")
"""What exporters write where they were given no names."""
_COCO = 80
_SHOWN = 12


@dataclass(frozen=True)
class PersonClasses:
    """The columns of a network's class scores that are people.

    Attributes:
        columns: from 0; a network may tell walking from sitting people.
        why: in words, for the log.
    """

    columns: tuple[int, ...]
    why: str


def person_classes(
    names: tuple[str, ...] | None, count: int, chosen: int | None
) -> PersonClasses:  # fmt: skip
    """The classes to look at.

    Args:
        names: what the file calls its classes, None where it does not say.
        count: of classes.
        chosen: what the user says, None for nothing.

    Raises:
        SettingsError: none is a person, or nothing tells which.
    """
    if names is not None and all(_NO_NAME.fullmatch(name.strip().lower()) for name in names):
        names = None
    if names is None:
        return _without_names(count, chosen)
    shown = ", ".join(name[:40] for name in names[:_SHOWN]) + (", ..." * (len(names) > _SHOWN))
    if chosen is not None:
        raise SettingsError(
            f"the file names its classes ({shown}), and --model-class {chosen} is for files that "
            "do not: leave it out"
        )
    columns = tuple(at for at, name in enumerate(names) if name.strip().lower() in _PEOPLE)
    if not columns:
        raise SettingsError(
            f"none of its {len(names)} classes is a person ({shown}): give a network that finds "
            "people"
        )
    found = ", ".join(f"{column} ({names[column][:40]})" for column in columns)
    return PersonClasses(columns, f"class {found} of {count}, by the names in the file")


def _without_names(count: int, chosen: int | None) -> PersonClasses:
    if chosen is not None:
        if chosen >= count:
            raise SettingsError(f"--model-class {chosen}: it has {count} classes, 0 to {count - 1}")
        return PersonClasses((chosen,), f"class {chosen} of {count}, as --model-class says")
    if count == 1:
        return PersonClasses((0,), "its only class, which the file does not name")
    if count == _COCO:
        return PersonClasses((0,), "class 0 of 80, COCO's person; the file names no classes")
    raise SettingsError(
        f"the file does not name its {count} classes: say which one is a person with "
        "--model-class N, from 0"
    )
