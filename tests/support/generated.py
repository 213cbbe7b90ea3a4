"""Hypothesis strategies: valid messages made from the exported JSON Schemas, and hostile bytes."""

from __future__ import annotations

import functools
import zlib
from typing import Any

import msgpack
from hypothesis import strategies as st

from heel.schemas.export import json_schemas

_TEXT = st.characters(codec="utf-8")


def valid_maps(name: str) -> st.SearchStrategy[dict[str, Any]]:
    """Maps that the schema of message `name` allows, as they would be packed."""
    contract = json_schemas()[name]["schema"]
    made = _object(contract, contract.get("$defs", {}))
    beyond_schema = {
        "target-request": made.filter(_is_complete),
        "blobs": made.map(with_boxes_by_the_frame).map(_with_scores).map(_with_one_sought),
    }  # fmt: skip
    return beyond_schema.get(name, made)


def with_boxes_by_the_frame(fields: dict[str, Any]) -> dict[str, Any]:
    """The blobs message with every box moved to where it is allowed."""

    def inside(blob: dict[str, Any]) -> dict[str, Any]:
        left, top, right, bottom = blob["box_xyxy"]
        left, right = _span(left, right, fields["width"])
        top, bottom = _span(top, bottom, fields["height"])
        return blob | {"box_xyxy": [left, top, right, bottom]}

    return fields | {"blobs": [inside(blob) for blob in fields.get("blobs", [])]}


def _with_scores(fields: dict[str, Any]) -> dict[str, Any]:
    """The blobs message with a score for everybody, where its blobs are people."""
    if fields.get("kind") != "people":
        return fields
    scored = [blob if blob.get("score") is not None else blob | {"score": 0.5}
              for blob in fields["blobs"]]  # fmt: skip
    return fields | {"blobs": scored}


def _with_one_sought(fields: dict[str, Any]) -> dict[str, Any]:
    """The blobs message with no more than one blob if one person is sought, and only of people."""
    if fields.get("sought") is None:
        return fields
    if fields.get("kind") != "people":
        return fields | {"sought": None}
    return fields | {"blobs": fields["blobs"][:1]}


def _span(one: float, other: float, most: int) -> tuple[float, float]:
    low, high = sorted(value % (3 * most) - most for value in (one, other))
    return (low, high) if low < high else (0.0, float(most))


def _is_complete(request: dict[str, Any]) -> bool:
    needs = {"id": ("track_id",), "point": ("x_px", "y_px")}
    return all(request.get(key) is not None for key in needs.get(request["mode"], ()))


def _object(schema: dict[str, Any], defs: dict[str, Any]) -> st.SearchStrategy[dict[str, Any]]:
    fields = {key: _value(field, defs) for key, field in schema["properties"].items()}
    required = {key: fields.pop(key) for key in schema.get("required", [])}
    return st.fixed_dictionaries(required, optional=fields)


def _value(schema: dict[str, Any], defs: dict[str, Any]) -> st.SearchStrategy[Any]:
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        special = {"Patch": _patches, "Evidence": _evidence}.get(name)
        return special() if special else _object(defs[name], defs)
    if "anyOf" in schema:
        return st.one_of([_value(option, defs) for option in schema["anyOf"]])
    if "const" in schema:
        return st.just(schema["const"])
    if "enum" in schema:
        return st.sampled_from(schema["enum"])
    return _BY_TYPE[schema["type"]](schema, defs)


def _integers(schema: dict[str, Any], _: dict[str, Any]) -> st.SearchStrategy[int]:
    most = schema.get("maximum", schema.get("exclusiveMaximum", 2**63) - 1)
    return st.integers(schema["minimum"], most)


def _numbers(schema: dict[str, Any], _: dict[str, Any]) -> st.SearchStrategy[float]:
    least = schema.get("minimum", schema.get("exclusiveMinimum"))
    most = schema.get("maximum", schema.get("exclusiveMaximum"))
    return st.floats(
        least, most, exclude_min="minimum" not in schema, exclude_max="maximum" not in schema
    )


def _strings(schema: dict[str, Any], _: dict[str, Any]) -> st.SearchStrategy[str | bytes]:
    if schema.get("format") == "binary":
        return st.binary(max_size=20)
    if "pattern" in schema:
        return st.from_regex(schema["pattern"].removesuffix("$") + r"\Z")
    least, most = schema.get("minLength", 0), schema.get("maxLength", 20)
    return st.text(_TEXT, min_size=least, max_size=min(20, most))


def _arrays(schema: dict[str, Any], defs: dict[str, Any]) -> st.SearchStrategy[list[Any]]:
    if "prefixItems" in schema:
        return st.tuples(*(_value(item, defs) for item in schema["prefixItems"])).map(list)
    least, most = schema.get("minItems", 0), schema["maxItems"]
    return st.lists(_value(schema["items"], defs), min_size=least, max_size=min(3, most))


def _maps(schema: dict[str, Any], defs: dict[str, Any]) -> st.SearchStrategy[dict[str, Any]]:
    if "properties" in schema:
        return _object(schema, defs)
    values = _value(schema["additionalProperties"], defs)
    return st.dictionaries(st.text(_TEXT, max_size=10), values, max_size=3)


_BY_TYPE: dict[str, Any] = {
    "integer": _integers, "number": _numbers, "string": _strings, "array": _arrays,
    "object": _maps, "boolean": lambda *_: st.booleans(), "null": lambda *_: st.none(),
}  # fmt: skip


@st.composite
def _patches(draw: st.DrawFn) -> dict[str, Any]:
    width, height = draw(st.integers(1, 5)), draw(st.integers(1, 5))
    size = width * height * 3
    return {"width": width, "height": height, "bgr": draw(st.binary(min_size=size, max_size=size))}


@st.composite
def _evidence(draw: st.DrawFn) -> dict[str, Any]:
    width, height = draw(st.integers(1, 20)), draw(st.integers(1, 20))
    size = 2 * ((width * height + 7) // 8)
    planes = draw(st.binary(min_size=size, max_size=size))
    return {"width": width, "height": height, "data": zlib.compress(planes, 1)}


def msgpack_values() -> st.SearchStrategy[Any]:
    """Anything that msgpack can pack, extensions and timestamps included."""
    leaves = st.one_of(
        st.none(), st.booleans(), st.integers(-(2**63), 2**64 - 1), st.floats(),
        st.text(_TEXT, max_size=20), st.binary(max_size=20),
        st.builds(msgpack.ExtType, st.integers(0, 127), st.binary(max_size=20)),
        st.builds(msgpack.Timestamp, st.integers(-(2**60), 2**60), st.integers(0, 10**9 - 1)),
    )  # fmt: skip
    keys = st.one_of(st.text(_TEXT, max_size=8), st.binary(max_size=8), st.integers(0, 9))
    return st.recursive(
        leaves,
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=4),
        max_leaves=12,
    )


def mutated(data: bytes) -> st.SearchStrategy[bytes]:
    """`data` with a few bytes replaced, removed or put in."""
    edits = st.lists(
        st.tuples(
            st.integers(0, len(data)), st.integers(0, 3), st.binary(max_size=4)
        ),  # where, how many bytes go, what comes instead
        min_size=1, max_size=4,
    )  # fmt: skip
    return edits.map(functools.partial(_edit, data))


def _edit(data: bytes, edits: list[tuple[int, int, bytes]]) -> bytes:
    for where, gone, new in edits:
        data = data[:where] + new + data[where + gone :]
    return data
