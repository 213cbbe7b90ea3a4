"""Asking for latched values: now and then without ever waiting, or once before a service starts."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import Generic, TypeVar

import zenoh

from heel.schemas import Message, MessageError, decode
from heel.services.runtime.asking import Question

_PERIOD_S = 2.0
"""Seconds between two questions; chosen by hand."""
_LONGEST_S = 1.0
"""Seconds after which a question asked once is over; chosen by hand."""
_LOOK_S = 0.01
"""Seconds between two looks at the answers to a question asked once; chosen by hand."""

M = TypeVar("M", bound=Message)


def _answers(question: Question) -> Iterator[zenoh.Sample]:
    for reply in question.replies():
        if reply.ok is not None:
            yield reply.ok


def latched_values(
    session: zenoh.Session, key: str, kind: type[M], log: logging.Logger, stop: threading.Event
) -> Iterator[M]:
    """Ask once for what is latched under `key`; answers that are no `kind` are logged.

    Ends as `latched_samples`.
    """
    for sample in latched_samples(session, (key,), stop):
        try:
            yield _decoded(kind, sample)
        except MessageError as error:
            log.warning("%s: %s", key, error)


def latched_samples(
    session: zenoh.Session, wanted: Iterable[str], stop: threading.Event
) -> Iterator[zenoh.Sample]:
    """Ask once for what is kept under some keys; yields the answers as they come.

    Ends when all have answered, after a second, or when `stop` is set, whichever is first.
    """
    questions = [Question(session, key, _LONGEST_S) for key in wanted]
    deadline_s = time.monotonic() + _LONGEST_S
    while not stop.is_set():
        for question in questions:
            yield from _answers(question)
        if all(question.over for question in questions) or time.monotonic() > deadline_s:
            return
        stop.wait(_LOOK_S)


class LatchedQuery(Generic[M]):
    """A question that a service loop repeats and looks after now and then, until it is answered.

    Args:
        session: the service's session.
        key: of the latched topic.
        kind: the message expected there.
    """

    def __init__(self, session: zenoh.Session, key: str, kind: type[M]) -> None:
        self._session = session
        self._key = key
        self._kind = kind
        self._question: Question | None = None
        self._asked_s = -math.inf

    def poll(self, now_s: float) -> M | None:
        """The value if an answer has come; asks anew every two seconds.

        Raises:
            MessageError: the answer is not the message expected.
        """
        if now_s - self._asked_s >= _PERIOD_S:
            self._asked_s = now_s
            self._question = Question(self._session, self._key, _PERIOD_S / 2)
        if self._question is None:
            return None
        sample = next(_answers(self._question), None)
        return None if sample is None else _decoded(self._kind, sample)


class LatchedAnswers(Generic[M]):
    """As `LatchedQuery`, for what several hold: the answers of all of them, once all have come.

    Args:
        session: the service's session.
        key: of the latched topic.
        kind: the message expected there; what is no such message is left out.
        period_s: seconds between two questions.
    """

    def __init__(
        self, session: zenoh.Session, key: str, kind: type[M], period_s: float = _PERIOD_S
    ) -> None:
        self._session = session
        self._key = key
        self._kind = kind
        self._period_s = period_s
        self._question: Question | None = None
        self._answers: list[M] = []
        self.asked_s = -math.inf
        """When the last question went out."""

    def poll(self, now_s: float) -> list[M] | None:
        """All answers to a question, which may be none; None while it is open.

        A question is over when all have answered, or after half a period.
        """
        if self._question is None and now_s - self.asked_s >= self._period_s:
            self.asked_s = now_s
            self._answers = []
            self._question = Question(self._session, self._key, self._period_s / 2)
        if self._question is None:
            return None
        for sample in _answers(self._question):
            with suppress(MessageError):
                self._answers.append(_decoded(self._kind, sample))
        if not self._question.over:
            return None
        self._question = None
        return self._answers


def _decoded(kind: type[M], sample: zenoh.Sample) -> M:
    return decode(kind, sample.payload.to_bytes(), str(sample.encoding))
