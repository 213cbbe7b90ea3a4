"""Asking for a latched value without ever waiting for the answer."""

from __future__ import annotations

from typing import Generic, TypeVar

import zenoh
from zenoh.handlers import FifoChannel, Handler

from schemas import Message, decode

_PERIOD_S = 2.0

M = TypeVar("M", bound=Message)


class LatchedQuery(Generic[M]):
    """A query that a service loop repeats and looks after now and then, until it is answered.

    Args:
        session: the service's session.
        key: of the latched topic.
        kind: the message expected there.
    """

    def __init__(self, session: zenoh.Session, key: str, kind: type[M]) -> None:
        self._session = session
        self._key = key
        self._kind = kind
        self._replies: Handler[zenoh.Reply] | None = None
        self._asked_s = float("-inf")

    def poll(self, now_s: float) -> M | None:
        """The value if an answer has come; asks anew every two seconds.

        Raises:
            MessageError: the answer is not the message expected.
        """
        if now_s - self._asked_s >= _PERIOD_S:
            self._asked_s = now_s
            # Not a RingChannel: it loses its replies when the query ends before they are read.
            self._replies = self._session.get(self._key, FifoChannel(4), timeout=_PERIOD_S / 2)
        if self._replies is None:
            return None
        try:
            reply = self._replies.try_recv()
        except zenoh.ZError:
            # The query is over, and nobody has answered.
            self._replies = None
            return None
        if reply is None or reply.ok is None:
            return None
        sample = reply.ok
        return decode(self._kind, sample.payload.to_bytes(), str(sample.encoding))
