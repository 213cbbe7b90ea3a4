"""What comes in from browsers: small JSON bodies, believed only after a check."""

from __future__ import annotations

import json
from typing import Any

from pydantic import ValidationError

from heel.schemas import HeelError, TargetRequest

MAX_BODY_BYTES = 4096
"""Of a request; ours have less than 200."""
_TARGET_KEYS = frozenset(TargetRequest.model_fields) - {"v"}


class BadRequestError(HeelError):
    """A request that cannot be understood."""


def target_request(body: bytes) -> TargetRequest:
    """Read the body of POST /api/target, e.g. `{"mode": "id", "track_id": 7}`.

    Raises:
        BadRequestError: not JSON, not an object, an unknown key, or not a target.
    """
    fields = _json_object(body)
    unknown = sorted(set(fields) - _TARGET_KEYS)
    if unknown:
        raise BadRequestError(
            f"unknown key {unknown[0][:40]!r}: known are {', '.join(sorted(_TARGET_KEYS))}"
        )
    try:
        return TargetRequest.model_validate(fields)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "target"
        raise BadRequestError(f"{where}: {first['msg']}") from None


def credentials(body: bytes) -> tuple[str, str]:
    """Read the body of POST /api/login, `{"user": "anna", "password": "..."}`.

    Raises:
        BadRequestError: anything else.
    """
    fields = _json_object(body)
    user, password = fields.get("user"), fields.get("password")
    if (
        set(fields) != {"user", "password"}
        or not isinstance(user, str)
        or (not isinstance(password, str))
    ):
        raise BadRequestError('send {"user": name, "password": word} and nothing else')
    return user[:64], password


def acknowledged_number(text: str) -> int:
    """Read a viewer's `{"ack": 12}`.

    Raises:
        BadRequestError: anything else.
    """
    number = _json_object(text.encode()).get("ack")
    if type(number) is not int:
        raise BadRequestError('viewers send {"ack": number} and nothing else')
    return number


def _json_object(body: bytes) -> dict[str, Any]:
    try:
        value = json.loads(body)
    # Deep nesting exhausts the parser's stack.
    except (ValueError, RecursionError) as error:
        raise BadRequestError(f"not JSON ({' '.join(str(error).split())[:80]})") from None
    if not isinstance(value, dict):
        raise BadRequestError(f"a JSON {type(value).__name__} instead of an object")
    return value
