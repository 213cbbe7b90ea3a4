"""Messages to bytes and back: msgpack maps, checked by pydantic, capped in size.

`decode` has exactly two outcomes for any bytes at all: the model, or a `MessageError`.
"""

from __future__ import annotations

from typing import TypeVar

import msgpack
from pydantic import ValidationError

from heel.schemas.base import Message
from heel.schemas.errors import MessageError

MessageT = TypeVar("MessageT", bound=Message)

# Bounds of what is unpacked at all: without them 256 kB of empty maps cost 8 s and 1 GB, most of it
# in listing the errors (measured). Every schema asks for less.
_MAX_ARRAY = 1024
"""Most elements of a list."""
_MAX_MAP = 256
"""Most entries of a map."""


def encode(message: Message) -> bytes:
    """Pack a message; equal messages give equal bytes.

    Raises:
        MessageError: the message is larger than its type's `max_bytes`.
    """
    packed: bytes = msgpack.packb(message.model_dump(), use_bin_type=True)
    if len(packed) > message.max_bytes:
        raise MessageError(
            f"{message.schema_name} of {len(packed)} bytes exceeds its cap of "
            f"{message.max_bytes}: send less in one message"
        )
    return packed


def decode(kind: type[MessageT], payload: bytes, encoding: str | None = None) -> MessageT:
    """Unpack and check a message.

    Args:
        kind: the message expected.
        payload: msgpack bytes.
        encoding: the Zenoh encoding that came with it; None skips that check (attachments
            carry none).

    Raises:
        MessageError: wrong encoding or version, too large, not msgpack, or not this message.
    """
    if encoding is not None and encoding != kind.encoding():
        raise MessageError(
            f"{kind.schema_name}: encoding {encoding[:80]!r} instead of {kind.encoding()!r}: "
            "send that encoding, or run matching versions"
        )
    unpacked = _unpack(kind, payload)
    version = unpacked.get("v")
    if version != kind.version:
        raise MessageError(
            f"{kind.schema_name}: version {_shown(version)} instead of {kind.version}: "
            "run matching versions"
        )
    try:
        return kind.model_validate(unpacked)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        # A location can hold text of the sender: the keys of a map.
        where = ascii(".".join(str(part) for part in first["loc"]))[1:-1][:80] or "message"
        raise MessageError(
            f"{kind.schema_name}: {where}: {first['msg']}: see `heel schema {kind.schema_name}`"
        ) from None


def _shown(version: object) -> str:
    # The value is of any type: the repr of a deep nest would raise RecursionError.
    return str(version) if isinstance(version, int) else f"of type {type(version).__name__}"


def _unpack(kind: type[Message], payload: bytes) -> dict[str, object]:
    if len(payload) > kind.max_bytes:
        raise MessageError(
            f"{kind.schema_name}: {len(payload)} bytes exceed the cap of {kind.max_bytes}: "
            "send less in one message"
        )
    try:
        unpacked = msgpack.unpackb(
            payload, raw=False, strict_map_key=True, max_array_len=_MAX_ARRAY, max_map_len=_MAX_MAP
        )
    # msgpack signals bad input through several unrelated types: ValueError and its own
    # FormatError/StackError/ExtraData, UnicodeDecodeError, and OverflowError or RecursionError
    # for hostile nesting (measured, tests/unit/schemas/test_codec.py).
    except (
        ValueError,
        TypeError,
        OverflowError,
        RecursionError,
        MemoryError,
        KeyError,
        msgpack.UnpackException,
    ) as error:
        raise MessageError(
            f"{kind.schema_name}: not msgpack ({type(error).__name__}): send a msgpack map"
        ) from None
    if not isinstance(unpacked, dict):
        raise MessageError(
            f"{kind.schema_name}: a msgpack {type(unpacked).__name__} instead of a map"
        )
    return unpacked
