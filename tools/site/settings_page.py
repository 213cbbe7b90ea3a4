"""The settings reference, made from the pydantic models that check the settings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

import heel.services.cli  # noqa: F401  (tells which tables there are)
from heel.services.runtime.settings import (
    LogSettings,
    ServiceSettings,
    ZenohSettings,
    known_tables,
)

_HEAD = "| setting | type | default | meaning |\n|---|---|---|---|\n"


def settings_page() -> str:
    """Markdown: a section for each table, in the order of `heel --help`, then the shared ones."""
    shared: dict[str, type[BaseModel]] = {"zenoh": ZenohSettings, "log": LogSettings}
    sections = [_section(name, model) for name, model in {**known_tables(), **shared}.items()]
    common = "## Every service\n\n" + _HEAD + "".join(_rows(ServiceSettings))
    return "\n".join([*sections, common])


def _section(name: str, model: type[BaseModel]) -> str:
    inherited = set(ServiceSettings.model_fields) if issubclass(model, ServiceSettings) else set()
    own = [row for field, row in zip(_fields(model), _rows(model), strict=True)
           if field not in inherited]  # fmt: skip
    more = "" if not inherited else "\nBesides, those of [every service](#every-service).\n"
    return f"## `[{name}]`\n\n{_HEAD}{''.join(own)}{more}"


def _fields(model: type[BaseModel]) -> Mapping[str, Any]:
    properties: Mapping[str, Any] = model.model_json_schema()["properties"]
    return properties


def _rows(model: type[BaseModel]) -> Iterator[str]:
    for name, schema in _fields(model).items():
        meaning = str(schema.get("description", "")).replace("|", "\\|")
        yield f"| `{name}` | {_kind(schema)} | {_default(schema)} | {meaning} |\n"


def _default(schema: Mapping[str, Any]) -> str:
    value = schema.get("default")
    if value is None or value in ("", []):
        return ""
    if isinstance(value, bool):
        return "`true`" if value else "`false`"
    return f"`{','.join(map(str, value)) if isinstance(value, list) else value}`"


def _kind(schema: Mapping[str, Any]) -> str:
    if "$ref" in schema:
        return str(schema["$ref"]).rpartition("/")[2]
    if "anyOf" in schema:
        return " or ".join(_kind(one) for one in schema["anyOf"] if one.get("type") != "null")
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    if "const" in schema:
        return f"`{schema['const']}`"
    kind = str(schema.get("type", ""))
    if kind in ("integer", "number"):
        return f"{kind}{_range(schema)}"
    named = {"path": "path", "file-path": "path", "password": "secret"}
    plain = {"boolean": "true or false", "array": "list, comma separated", "string": "text"}
    return named.get(str(schema.get("format", "")), plain.get(kind, kind))


_LOW = (("minimum", "from"), ("exclusiveMinimum", "above"))
_HIGH = (("maximum", "to"), ("exclusiveMaximum", "below"))


def _range(schema: Mapping[str, Any]) -> str:
    ends = [f"{word} {schema[key]:g}" for key, word in (*_LOW, *_HIGH) if key in schema]
    return f", {' '.join(ends)}" if ends else ""
