"""The tables of docs/reference/wire.md, made from the schemas.

`python -m tools.site.wire_tables` rewrites them; a test compares.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from heel.schemas.export import json_schemas
from tools.site import REPOSITORY

DOCUMENT = REPOSITORY / "docs" / "reference" / "wire.md"
_TABLE = re.compile(r"(<!-- fields: ([A-Za-z-]+) -->\n).*?(<!-- end of fields -->)", re.DOTALL)
_INT63 = 2**63


def tables() -> dict[str, str]:
    """Markdown table of the fields of every message and every part of one, by name."""
    made: dict[str, str] = {}
    for name, contract in json_schemas().items():
        schema = contract["schema"]
        made[name] = _table(schema)
        for part, definition in schema.get("$defs", {}).items():
            if part != "Target":
                made[part] = _table(definition)
    return made


def rewritten(text: str) -> str:
    """The document with every table between its markers made anew."""
    made = tables()
    return _TABLE.sub(lambda found: found[1] + made[found[2]] + found[3], text)


def named(text: str) -> list[str]:
    """The names of the tables in the document, in its order."""
    return [found[2] for found in _TABLE.finditer(text)]


def _table(schema: dict[str, Any]) -> str:
    required = set(schema.get("required", []))
    rows = ["| field | type | default | meaning |", "|---|---|---|---|"]
    for name, field in schema["properties"].items():
        default = "required" if name in required else f"`{_literal(field.get('default', {}))}`"
        rows.append(f"| `{name}` | {_type(field)} | {default} | {field.get('description', '')} |")
    return "\n".join(rows) + "\n"


def _literal(value: Any) -> str:
    return "nil" if value is None else json.dumps(value)


def _type(field: dict[str, Any]) -> str:
    if "$ref" in field:
        return f"[{field['$ref'].rpartition('/')[2]}]"
    if "anyOf" in field:
        return " or ".join(_type(option) for option in field["anyOf"])
    if "const" in field:
        return f"`{field['const']}`"
    if "enum" in field:
        return ", ".join(f"`{value}`" for value in field["enum"])
    return str(_BY_TYPE[field["type"]](field))


def _number(field: dict[str, Any]) -> str:
    word = "int" if field["type"] == "integer" else "float"
    low = f"{field['minimum']:g} <=" if "minimum" in field else f"{field['exclusiveMinimum']:g} <"
    if "maximum" in field:
        high = f"<= {field['maximum']:g}"
    else:
        most = field["exclusiveMaximum"]
        high = "< 2^63" if most == _INT63 else "< 2^31" if most == 2**31 else f"< {most:g}"
    return f"{word}, {low} x {high}"


def _string(field: dict[str, Any]) -> str:
    if field.get("format") == "binary":
        return f"bin, at most {field['maxLength']} bytes"
    if "pattern" in field:
        return f"str `{field['pattern']}`"
    return f"str, at most {field['maxLength']} characters" if "maxLength" in field else "str"


def _array(field: dict[str, Any]) -> str:
    if "prefixItems" in field:
        return f"array of {len(field['prefixItems'])}, each {_type(field['prefixItems'][0])}"
    return f"array, at most {field['maxItems']}, of {_type(field['items'])}"


_BY_TYPE: dict[str, Any] = {
    "integer": _number, "number": _number, "string": _string, "array": _array,
    "boolean": lambda _: "bool", "null": lambda _: "nil",
    "object": lambda field: f"map of str to str, at most {field['maxProperties']}",
}  # fmt: skip


if __name__ == "__main__":
    path = Path(DOCUMENT)
    path.write_text(rewritten(path.read_text()))
