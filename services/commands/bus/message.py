"""What one message is, as far as it can be told: its kind, its sender, its frame, its content.

Any bytes at all may come: what cannot be decoded is said, and never raised.
"""

from __future__ import annotations

import json
import math
import time
from dataclasses import dataclass
from typing import Any

from heel.schemas import MESSAGES, Header, Message, MessageError, Stamp, decode
from heel.services.runtime.logs import printable

_BY_ENCODING = {kind.encoding(): kind for kind in MESSAGES}
_LONGEST_TEXT_BYTES = 65536
"""Of a text or JSON that is shown; as large as the largest answer of a service's settings."""
_LONGEST_LINE = 2000
"""Characters of a message as one line; chosen by hand. `--json` shows all of it."""
_DIGITS = 5
"""Significant digits of a number in a line; chosen by hand."""
_FRAME = frozenset({"stream", "epoch", "seq", "index", "t_capture_ns"})


@dataclass(frozen=True, slots=True)
class Received:
    """One message as it came off the wire.

    Attributes:
        key: that it was sent on.
        arrived_s: monotonic.
        size: payload bytes.
        encoding: as the sender names it; not to be trusted as text for a terminal.
        attachment: bytes, None without one.
        payload: bytes; None for what is not looked into, such as pixels.
    """

    key: str
    arrived_s: float
    size: int
    encoding: str
    attachment: bytes | None
    payload: bytes | None


@dataclass(frozen=True, slots=True)
class Told:
    """What a message says.

    Attributes:
        kind: its schema's name, `image`, `text`, or `?`.
        content: a message of Heel's, or the fields of what is none; None: it cannot be decoded.
        problem: why it cannot be decoded; empty if it can.
        producer: that sent it; None where it does not say.
        age_s: of its frame when it was sent, seconds; None where it does not say.
        counted: `(producer, epoch, seq)` of what is numbered without gaps; None of other messages.
    """

    kind: str
    content: Message | dict[str, Any] | None
    problem: str = ""
    producer: str | None = None
    age_s: float | None = None
    counted: tuple[str, int, int] | None = None


def kind_of(encoding: str) -> str:
    """The name of what an encoding stands for; `?` for one that is not Heel's."""
    known = _BY_ENCODING.get(encoding)
    if known is not None:
        return known.schema_name
    return "image" if encoding.startswith("image/") else "?"


def tell(received: Received) -> Told:
    """What a message says; never raises."""
    encoding = received.encoding
    try:
        if encoding.startswith("image/"):
            return _tell_image(received)
        if (kind := _BY_ENCODING.get(encoding)) is not None and received.payload is not None:
            return _tell_message(kind, received.payload, received)
    except MessageError as error:
        return Told(kind_of(encoding), None, str(error))
    return _tell_text(received)


def _tell_image(received: Received) -> Told:
    if received.attachment is None:
        return Told("image", None, "an image without its header, which goes in the attachment")
    header = decode(Header, received.attachment)
    content = header.model_dump(mode="json", exclude={"v", "producer", "age_ns"})
    return Told(
        "image", content | {"bytes": received.size}, producer=header.producer,
        age_s=header.age_ns / 1e9, counted=(header.producer, header.epoch, header.seq),
    )  # fmt: skip


def _tell_message(kind: type[Message], payload: bytes, received: Received) -> Told:
    message = decode(kind, payload, received.encoding)
    stamp = None if received.attachment is None else decode(Stamp, received.attachment)
    producer = getattr(message, "producer", None) if stamp is None else stamp.producer
    seq, epoch = getattr(message, "seq", None), getattr(message, "epoch", 0)
    return Told(
        kind.schema_name, message, producer=producer,
        age_s=None if stamp is None else stamp.age_ns / 1e9,
        # Without a stamp a number counts changes, or names a frame that others count.
        counted=None if stamp is None or seq is None else (stamp.producer, epoch, seq),
    )  # fmt: skip


def _tell_text(received: Received) -> Told:
    name = received.encoding[:80]
    payload = received.payload
    if payload is None or len(payload) > _LONGEST_TEXT_BYTES:
        return Told("?", None, f"{received.size} bytes of encoding {name!r}")
    if name.startswith(("application/json", "text/json")):
        try:
            content = json.loads(payload)
        except (ValueError, RecursionError):
            return Told("?", None, f"encoding {name!r}, but it is no JSON")
        return Told("json", content if isinstance(content, dict) else {"value": content})
    if name.startswith("text/"):
        return Told("text", {"text": payload.decode("utf-8", "replace")})
    shown = payload[:32].hex(" ") + (" ..." if len(payload) > 32 else "")
    return Told("?", None, f"encoding {name!r} is none of Heel's: {received.size} bytes: {shown}")


def as_line(key: str, told: Told) -> str:
    """A message as one line that a terminal only shows; what has its default is left out."""
    sender = "" if told.producer is None else f" {told.producer.partition('@')[0]}"
    age = "" if told.age_s is None else f" {told.age_s * 1e3:.0f} ms old"
    words = told.problem or _fields(told)
    mark = "undecodable: " if told.problem else ""
    return printable(f"{key}{sender}{age}  {mark}{words}", _LONGEST_LINE)


def _fields(told: Told) -> str:
    content = told.content
    fields = _dump(content, brief=True) if isinstance(content, Message) else dict(content or {})
    if fields.keys() >= _FRAME:
        # Of the frame its number: the rest is the same in every line.
        fields = {name: one for name, one in fields.items() if name not in _FRAME - {"seq"}}
    fields.pop("producer", None)
    return " ".join(f"{name}={_value(value)}" for name, value in fields.items())


def _dump(message: Message, brief: bool = False) -> dict[str, Any]:
    return message.model_dump(mode="json", exclude_defaults=brief)


def _value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.{_DIGITS}g}"
    if isinstance(value, dict):
        inner = (f"{name}={_value(one)}" for name, one in value.items())
        return "{" + " ".join(inner) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else str(value)


def as_object(key: str, told: Told) -> dict[str, Any]:
    """A message whole, for `--json`."""
    found: dict[str, Any] = {"t": time.time(), "key": key, "kind": told.kind}
    if told.producer is not None:
        found["producer"] = told.producer
    if told.age_s is not None:
        found["age_ms"] = round(told.age_s * 1e3, 3)
    if told.problem:
        return found | {"problem": told.problem}
    content = told.content
    whole = _dump(content) if isinstance(content, Message) else content
    return found | {"message": _finite(whole)}


def _finite(value: Any) -> Any:
    """JSON has no infinity and no NaN, which ranges may be: `inf`, `-inf`, `nan` as text."""
    if isinstance(value, dict):
        return {name: _finite(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_finite(one) for one in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
