"""JSON Schema of every message, so that a service in another language can be written against it.

The schemas describe the msgpack maps on the wire: `format: binary` marks what travels as msgpack
`bin`, everything else is the msgpack type of the same name.
"""

from __future__ import annotations

from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from heel.schemas import MESSAGES
from heel.schemas.base import Message

DIALECT = GenerateJsonSchema.schema_dialect


class _WireSchema(GenerateJsonSchema):
    def bytes_schema(self, schema: core_schema.BytesSchema) -> JsonSchemaValue:
        """Bytes stay bytes in msgpack; JSON's base64 detour does not exist here."""
        made: JsonSchemaValue = {"type": "string", "format": "binary"}
        if "max_length" in schema:
            made["maxLength"] = schema["max_length"]
        return made


def json_schemas() -> dict[str, dict[str, Any]]:
    """Contract of every message by name: encoding, version, size cap in bytes and JSON Schema."""
    return {kind.schema_name: _contract(kind) for kind in MESSAGES}


def _contract(kind: type[Message]) -> dict[str, Any]:
    schema = kind.model_json_schema(schema_generator=_WireSchema)
    # The wire has no default for it: a message without a version is refused.
    schema["properties"]["v"] = {
        "type": "integer", "const": kind.version, "description": "schema version",
    }  # fmt: skip
    schema["required"] = ["v", *schema.get("required", [])]
    return {
        "name": kind.schema_name,
        "encoding": kind.encoding(),
        "version": kind.version,
        "max_bytes": kind.max_bytes,
        "schema": {"$schema": DIALECT, **schema},
    }
