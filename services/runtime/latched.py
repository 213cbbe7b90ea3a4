"""Asking for a latched value without ever waiting for the answer."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Generic, TypeVar

import zenoh
from zenoh.handlers import FifoChannel, Handler

from heel.schemas import Message, MessageError, decode

_PERIOD_S = 2.0
_MOST_ANSWERS = 16

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
            self._replies = self._session.get(
                self._key, FifoChannel(4), timeout=_PERIOD_S / 2,
                congestion_control=zenoh.CongestionControl.DROP,
            )  # fmt: skip
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


class LatchedAnswers(Generic[M]):
    """As `LatchedQuery`, for what several hold: the answers of all of them, once all have come.

    Args:
        session: the service's session.
        key: of the latched topic.
        kind: the message expected there; what is no such message is left out.
        period_s: between two questions.
    """

    def __init__(
        self, session: zenoh.Session, key: str, kind: type[M], period_s: float = _PERIOD_S
    ) -> None:
        self._session = session
        self._key = key
        self._kind = kind
        self._period_s = period_s
        self._replies: Handler[zenoh.Reply] | None = None
        self._answers: list[M] = []
        self.asked_s = -math.inf
        """When the last question went out."""

    def poll(self, now_s: float) -> list[M] | None:
        """All answers to a question, which may be none; None while it is open.

        A question is over when all have answered, or after half a period.
        """
        if self._replies is None and now_s - self.asked_s >= self._period_s:
            self.asked_s = now_s
            self._answers = []
            self._replies = self._session.get(
                self._key, FifoChannel(_MOST_ANSWERS), timeout=self._period_s / 2,
                congestion_control=zenoh.CongestionControl.DROP,
            )  # fmt: skip
        while self._replies is not None:
            try:
                reply = self._replies.try_recv()
            except zenoh.ZError:
                self._replies = None
                return self._answers
            if reply is None:
                return None
            if reply.ok is not None and len(self._answers) < _MOST_ANSWERS:
                with suppress(MessageError):
                    self._answers.append(
                        decode(self._kind, reply.ok.payload.to_bytes(), str(reply.ok.encoding))
                    )
        return None
