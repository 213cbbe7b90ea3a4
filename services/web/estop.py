"""What the page knows of the emergency stop, and when a stop must be said again."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Literal

from heel.schemas import EStop
from heel.services.runtime.stop_latch import StopLatch

REPEAT_AFTER_S = 0.2
"""Seconds after which an unconfirmed stop is said again; chosen by hand."""
_FRESH_S = 1.0
"""A word of the robot counts so long: five of a follower's."""
_KNOWN_S = 10.0
"""A part that has said something within this time is expected to answer."""
_MISSED_STOP_S = 1.0
"""So long drive and follower hold a stop that the page does not know of until it believes them."""
_MISSED_RELEASE_S = 4.0
"""So long drive and follower contradict the page until it believes that it has missed something.
Both ask one another once a second: what only the page holds they would have taken from it."""

Part = Literal["drive", "follower"]


class PageStop:
    """Follows the emergency stop; a stop asked for here is repeated until it is confirmed.

    A STOP pressed while the router is away must not get lost: it stays pending and goes out as
    soon as it can be heard. A resume is never repeated.
    """

    def __init__(self) -> None:
        self._latch = StopLatch()
        self._words: dict[Part, tuple[bool, float]] = {}
        self._others: tuple[EStop, ...] = ()
        self._pressed: EStop | None = None
        self._pressed_s = self._said_s = 0.0
        self._odd_since_s: float | None = None

    @property
    def told(self) -> EStop | None:
        """What to answer to a question."""
        return self._latch.told

    @property
    def source(self) -> str:
        """The source that engaged or released it."""
        return "" if self._latch.told is None else self._latch.told.source

    def engaged(self, now_s: float) -> bool:
        """Whether the robot has to stand, by what was said and by its own word."""
        return self._latch.engaged or self._any_stands(now_s)

    def engage(self, message: EStop, now_s: float) -> None:
        """STOP was pressed on the page."""
        self.hear(message, now_s)
        self._pressed, self._pressed_s, self._said_s = message, now_s, now_s

    def hear(self, message: EStop, now_s: float) -> None:
        """A stop or a release went over `follow/estop`, from any sender."""
        self._latch.hear(message, now_s)
        self._odd_since_s = None
        if not self._latch.engaged:
            self._pressed = None

    def hear_answers(self, answers: Iterable[EStop], asked_s: float) -> None:
        """What drive and follower hold, when they were asked."""
        answers = list(answers)
        self._others = tuple(answer for answer in answers if answer.engaged)
        self._latch.hear_answers(answers, asked_s)
        if not self._latch.engaged:
            self._pressed = None

    def says(self, part: Part, stopped: bool, now_s: float) -> None:
        """The robot's own word of this moment."""
        self._words[part] = stopped, now_s
        if stopped and self._pressed is not None and now_s > self._pressed_s:
            drives = self._words.get("drive")
            # The drive is the one that turns the wheels, where there is one.
            if part == "drive" or drives is None or now_s - drives[1] >= _KNOWN_S:
                self._pressed = None

    def settle(self, now_s: float) -> None:
        """Believe the robot where it has contradicted what was heard for long enough."""
        fresh = [stopped for stopped, t in self._words.values() if now_s - t < _FRESH_S]
        stands = any(fresh)
        if self._pressed is not None or not fresh or stands == self._latch.engaged:
            self._odd_since_s = None
            return
        since_s = self._odd_since_s = now_s if self._odd_since_s is None else self._odd_since_s
        if stands and now_s - since_s >= _MISSED_STOP_S:
            self._latch.hear(EStop(engaged=True, source="the robot"), now_s)
        elif not stands and now_s - since_s >= _MISSED_RELEASE_S:
            self._latch.forget()

    def releases(self, source: str) -> list[EStop]:
        """What ends every engagement that is known."""
        held = (*self._others, *([self._latch.current] if self._latch.current else []))
        named = {one.id: one for one in held}
        t_ns = time.time_ns()
        return [
            EStop(engaged=False, source=source, t_ns=max(t_ns, one.t_ns), id=one.id)
            for one in named.values()
        ] or [EStop(engaged=False, source=source, t_ns=t_ns)]

    def silent(self, now_s: float) -> Part | None:
        """A part that was there just now and does not answer."""
        for part, (_, t) in self._words.items():
            if _FRESH_S <= now_s - t < _KNOWN_S:
                return part
        return None

    def pending(self) -> EStop | None:
        """The stop asked for here that is not confirmed."""
        return self._pressed

    def pending_s(self, now_s: float) -> float | None:
        """How long a stop has waited for its confirmation; None if none does."""
        return None if self._pressed is None else now_s - self._pressed_s

    def repeat_due(self, now_s: float) -> bool:
        """Whether the stop is to be said again now; True counts as said."""
        if self._pressed is None or now_s - self._said_s < REPEAT_AFTER_S:
            return False
        self._said_s = now_s
        return True

    def _any_stands(self, now_s: float) -> bool:
        return any(stopped and now_s - t < _FRESH_S for stopped, t in self._words.values())
