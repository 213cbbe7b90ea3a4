"""ROS messages without ROS: empty ones, their bytes (CDR), and the hashes of their definitions."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from heel.schemas.errors import HeelError, MessageError


class Messages:
    """The types of ROS, which are the same in every release since Humble as far as Heel has any.

    Raises:
        HeelError: the library is not installed.
    """

    def __init__(self) -> None:
        """Load them: a tenth of a second."""
        self._store = _store()

    def empty(self, kind: str) -> Any:
        """A message of a type such as `geometry_msgs/msg/Twist`, all zero.

        Raises:
            HeelError: no such type is known.
        """
        from rosbags.interfaces import Nodetype

        self._check(kind)
        fields: Any = self._store.fielddefs[kind][1]
        values: dict[str, Any] = {}
        for name, (node, detail) in fields:
            if node is Nodetype.NAME:
                values[name] = self.empty(detail)
            elif node is Nodetype.BASE:
                values[name] = _zero(detail[0])
            else:
                values[name] = self._row(detail[0], detail[1] if node is Nodetype.ARRAY else 0)
        return self._store.types[kind](**values)

    def encoded(self, message: Any) -> bytes:
        """Its bytes: little endian, with the header of four that says so."""
        return bytes(self._store.serialize_cdr(message, message.__msgtype__))

    def decoded(self, payload: bytes, kind: str) -> Any:
        """The message of these bytes; what is long in it is a view of them.

        Raises:
            MessageError: they are no such message.
        """
        from rosbags.serde import SerdeError

        try:
            return self._store.deserialize_cdr(memoryview(payload), kind)
        except SerdeError as error:
            raise MessageError(f"{len(payload)} bytes are no {kind}: {error}") from None

    def type_hash(self, kind: str) -> str:
        """Hash of the definition, as `RIHS01_9c45…` (REP 2011).

        Raises:
            HeelError: no such type is known.
        """
        self._check(kind)
        return str(self._store.hash_rihs01(kind))

    def _check(self, kind: str) -> None:
        if kind not in self._store.fielddefs:
            raise HeelError(f"{kind} is not known without ROS: name no topic for it, or --rmw dds")

    def _row(self, of: Any, length: int) -> Any:
        """A row of zeros, empty where its length is free; numbers are an array."""
        from rosbags.interfaces import Nodetype

        node, detail = of
        if node is Nodetype.NAME:
            return [self.empty(detail) for _ in range(length)]
        if detail[0] == "string":
            return [""] * length
        return np.zeros(length, detail[0])


def _zero(kind: str) -> Any:
    if kind == "string":
        return ""
    return kind != "bool" and (0.0 if kind.startswith("float") else 0)


@lru_cache(maxsize=1)
def _store() -> Any:
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise HeelError("--rmw zenoh needs a library: pip install rosbags") from None
    return get_typestore(Stores.LATEST)
