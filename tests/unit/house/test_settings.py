"""The settings of the product: how many there are, and that each says what it is in which unit."""

from __future__ import annotations

import re

import pytest
from pydantic.fields import FieldInfo

import heel.services.cli  # noqa: F401  (tells which tables there are)
from heel.services.capture.pan_window import PanSettings
from heel.services.capture.scene.settings import SceneSettings
from heel.services.capture.settings import CaptureSettings
from heel.services.runtime.settings import (
    LogSettings,
    ServiceSettings,
    ZenohSettings,
    known_tables,
)

MOST = 198
MODELS = {
    **known_tables(),
    "zenoh": ZenohSettings,
    "log": LogSettings,
    "source scene:": SceneSettings,
    "source pan:": PanSettings,
}
"""Everything that a user can set, by the table or the source that takes it."""
_UNITS = {
    "_s": r"\bs\b|second|time|how long|stops? this long|so long|wait|older|after|less:",
    "_px": r"pixel|picture|side",
    "_ms": r"\bms\b",
    "_deg": r"degree|\bdeg\b",
}


def settings() -> dict[str, FieldInfo]:
    """Every setting once; what all services have counts once, too."""
    found = {f"service.{name}": field for name, field in ServiceSettings.model_fields.items()}
    for table, model in MODELS.items():
        shared = ServiceSettings.model_fields if issubclass(model, ServiceSettings) else {}
        found |= {
            f"{table}.{name}": field
            for name, field in model.model_fields.items()
            if name not in shared
        }
    return found


def test_there_are_no_more_settings_than_a_user_can_survey() -> None:
    found = settings()
    per_table: dict[str, int] = {}
    for name in found:
        table = name.partition(".")[0]
        per_table[table] = per_table.get(table, 0) + 1
    print(f"{len(found)} settings:", ", ".join(f"{k} {n}" for k, n in per_table.items()))
    assert len(found) <= MOST, per_table
    assert CaptureSettings in MODELS.values()


@pytest.mark.parametrize("name", settings())
def test_a_setting_says_what_it_is(name: str) -> None:
    field = settings()[name]
    assert field.description, name
    for ending, words in _UNITS.items():
        if name.endswith(ending):
            assert re.search(words, field.description), f"{name}: name the unit"
