"""What holds the emergency stop, and what releases it. No transport, no clock of its own."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable

from heel.schemas import EStop

_REMEMBERED = 64
"""Engagements that are known to be over; chosen by hand, no user stops so often within a minute."""
_DOUBT_S = 3.0
"""An answer without an id that was asked for so soon before or after a release may be an old one:
longer than two deadlines of a question."""


class StopLatch:
    """The emergency stop as a process that obeys it holds it.

    An engagement has an id, drawn by the sender; a newer engagement takes the place of an
    older one. A release ends the engagement that it names and no other, so that an old release
    that is played again releases nothing. A release without id ends an engagement without id, if it
    is not older.
    """

    def __init__(self) -> None:
        self.current: EStop | None = None
        """The engagement that holds."""
        self.told: EStop | None = None
        """What to answer to a question: the engagement, or the release that ended the last one."""
        self._over: deque[str] = deque(maxlen=_REMEMBERED)
        self._released_s = -math.inf

    @property
    def engaged(self) -> bool:
        """Whether the robot has to stand."""
        return self.current is not None

    def hear(self, message: EStop, now_s: float) -> bool:
        """Take what has just been said; False if it changes nothing.

        Args:
            message: as it was published.
            now_s: monotonic time of its arrival.
        """
        if message.engaged:
            return self._engage(message)
        return self._release(message, now_s)

    def hear_answers(self, answers: Iterable[EStop], asked_s: float) -> bool:
        """Take what others answered when they were asked; False if it changes nothing.

        An answer engages, unless its engagement is known to be over here or with another that
        answers; it releases only what it names by its id.
        """
        answers = list(answers)
        changed = False
        for answer in answers:
            if not answer.engaged and answer.id:
                changed |= self._release(answer, asked_s)
        for answer in answers:
            if answer.engaged and not self.engaged and not self._is_over(answer, asked_s):
                changed |= self._engage(answer)
        return changed

    def restore(self, kept: EStop) -> None:
        """Hold an engagement that an earlier process left behind."""
        if kept.engaged:
            self._engage(kept)

    def forget(self) -> None:
        """No process that obeys holds the engagement any more: its release was missed."""
        if self.current is not None:
            self._note_over(self.current)
        self.current = self.told = None

    def _is_over(self, answer: EStop, asked_s: float) -> bool:
        return answer.id in self._over if answer.id else asked_s < self._released_s + _DOUBT_S

    def _engage(self, message: EStop) -> bool:
        held = self.current
        if held is not None:
            newer = message.id not in (held.id, "") and message.id not in self._over
            later = message.id == held.id and message.t_ns > held.t_ns
            if not newer and not later:
                return False
        self.current = self.told = message
        return held is None or held.id != message.id

    def _release(self, message: EStop, now_s: float) -> bool:
        held = self.current
        if held is None:
            # A process that answers later that this engagement holds has missed its end.
            self._note_over(message)
            return False
        if message.id != held.id or (not message.id and message.t_ns < held.t_ns):
            return False
        self._note_over(message)
        self._released_s = now_s
        self.current, self.told = None, message
        return True

    def _note_over(self, message: EStop) -> None:
        if message.id and message.id not in self._over:
            self._over.append(message.id)
