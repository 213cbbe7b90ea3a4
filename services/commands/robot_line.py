"""A connection to the robot that never blocks its caller, which reads the state meanwhile."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

from heel.schemas import (
    DriveState,
    EStop,
    FollowState,
    HeelError,
    Message,
    MessageError,
    Stamp,
    decode,
    encode,
    keys,
)
from heel.services.commands.robot import Where

if TYPE_CHECKING:
    import zenoh

MessageT = TypeVar("MessageT", bound=Message)
REPEAT_S = 0.05
"""Seconds between two sendings of one message: 20 a second bridge losses and are no flood; chosen
by hand."""
_ASK_S = 0.3
"""Seconds between two rounds of questions, so that several fit into a command; chosen by hand."""
_QUESTION_S = 1.0
"""Longest wait for the answers to one question [s]; chosen by hand."""
_FRESH_S = 0.5
"""Age up to which a drive's state holds [s]; a drive sends 50 a second. Chosen by hand."""
_FOLLOWER_FRESH_S = 1.0
"""Age up to which a follower's state holds [s]; a follower sends five a second. Chosen by hand."""
_MOST_VOICES = 32
"""Drives, and engagements, that are remembered: bounds the memory in a flood; chosen by hand."""


@dataclass
class Heard:
    """State received so far; read and written under the line's lock."""

    connected: bool = False
    failure: str = ""
    """Why there is no connection; "" while it is being tried."""
    said: int = 0
    """Messages that were sent."""
    drives: dict[str, tuple[DriveState, float]] = field(default_factory=dict)
    """Newest state of every drive, by producer, and the monotonic time of its arrival."""
    follower: tuple[FollowState, float] | None = None
    engagements: dict[str, EStop] = field(default_factory=dict)
    """Engaged emergency stops that processes have replied, by id."""
    held_since_s: dict[str, float] = field(default_factory=dict)
    """Monotonic time since which each of them has held, by the process that has held it longest."""
    alive: set[str] = field(default_factory=set)
    """Kinds of services that are present, by their tokens: `drive`, `follower`."""

    def fresh_drives(self, now_s: float) -> dict[str, DriveState]:
        """Drives' states that are not older than `_FRESH_S`."""
        return {name: state for name, (state, t) in self.drives.items() if now_s - t < _FRESH_S}

    def fresh_follower(self, now_s: float) -> FollowState | None:
        """A follower's state that is not older than `_FOLLOWER_FRESH_S`."""
        if self.follower is None or now_s - self.follower[1] >= _FOLLOWER_FRESH_S:
            return None
        return self.follower[0]


class RobotLine:
    """Connects, listens, asks and repeats messages, all in threads that block no caller.

    Zenoh may block for ten seconds where a router hangs or an address does not answer.

    Args:
        where: the robot to talk to.
    """

    def __init__(self, where: Where) -> None:
        self._where = where
        self._changed = threading.Condition()
        self._heard = Heard()
        self._messages: tuple[EStop, ...] = ()
        self._closing = False
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="robot-line", daemon=True)
        self._thread.start()

    def say(self, messages: Iterable[EStop]) -> None:
        """Send these again and again from now on, in place of earlier ones."""
        with self._changed:
            self._messages = tuple(messages)
            self._heard.said = 0
            self._changed.notify_all()

    def wait(self, enough: Callable[[Heard, float], bool], deadline_s: float) -> bool:
        """Whether enough was received before the deadline.

        Args:
            enough: predicate of the state received and the monotonic time.
            deadline_s: monotonic.
        """
        with self._changed:
            while not enough(self._heard, now_s := time.monotonic()):
                if now_s >= deadline_s:
                    return False
                self._changed.wait(min(REPEAT_S, deadline_s - now_s))
        return True

    def look(self) -> Heard:
        """State received; nothing more is written to it once the line is closed."""
        return self._heard

    def close(self, timeout_s: float) -> bool:
        """End the line; False if Zenoh still blocks then."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        return self._closed.wait(timeout_s)

    def _run(self) -> None:
        try:
            self._talk()
        except (HeelError, RuntimeError) as error:
            with self._changed:
                self._heard.failure = str(error)
                self._changed.notify_all()
        finally:
            self._closed.set()

    def _talk(self) -> None:
        import zenoh

        from heel.services.commands.robot import session_with

        with session_with(self._where) as session:
            subscribers = [
                session.declare_subscriber(keys.ROBOT_DRIVE, self._note_drive),
                session.declare_subscriber(keys.FOLLOW_STATE, self._note_follower),
            ]
            publisher = session.declare_publisher(
                keys.FOLLOW_ESTOP, express=True, priority=zenoh.Priority.REAL_TIME,
                congestion_control=zenoh.CongestionControl.DROP,
            )  # fmt: skip
            with self._changed:
                self._heard.connected = True
                self._changed.notify_all()
            asked_s = float("-inf")
            while True:
                with self._changed:
                    if self._closing:
                        break
                    messages = self._messages
                for message in messages:
                    publisher.put(encode(message), encoding=message.encoding())
                with self._changed:
                    self._heard.said += bool(messages)
                    self._changed.notify_all()
                if time.monotonic() - asked_s >= _ASK_S:
                    asked_s = time.monotonic()
                    self._ask(session)
                with self._changed:
                    if not self._closing:
                        self._changed.wait_for(self._has_news(messages), REPEAT_S)
            for subscriber in subscribers:
                subscriber.undeclare()  # type: ignore[no-untyped-call]

    def _has_news(self, said: tuple[EStop, ...]) -> Callable[[], bool]:
        return lambda: self._closing or self._messages is not said

    def _ask(self, session: zenoh.Session) -> None:
        import zenoh

        from heel.services.runtime.asking import EVERY_ANSWER, EVERYBODY

        for key, note in (
            (keys.FOLLOW_STATE, self._note_follower_reply),
            (keys.FOLLOW_ESTOP, self._note_engagement),
        ):
            session.get(
                key, note, target=EVERYBODY, consolidation=EVERY_ANSWER, timeout=_QUESTION_S,
                congestion_control=zenoh.CongestionControl.DROP,
            )  # fmt: skip
        session.liveliness().get(keys.ALL_ALIVE, self._note_alive, timeout=_QUESTION_S)

    def _note_drive(self, sample: zenoh.Sample) -> None:
        with suppress(MessageError):
            state = decode(DriveState, sample.payload.to_bytes(), str(sample.encoding))
            attached = sample.attachment
            producer = "" if attached is None else decode(Stamp, attached.to_bytes()).producer
            with self._changed:
                if producer in self._heard.drives or len(self._heard.drives) < _MOST_VOICES:
                    self._heard.drives[producer] = state, time.monotonic()
                self._changed.notify_all()

    def _note_follower(self, sample: zenoh.Sample) -> None:
        if (state := _read(FollowState, sample)) is not None:
            with self._changed:
                self._heard.follower = state, time.monotonic()
                self._changed.notify_all()

    def _note_follower_reply(self, reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            self._note_follower(reply.ok)

    def _note_engagement(self, reply: zenoh.Reply) -> None:
        if reply.ok is None or (estop := _read(EStop, reply.ok)) is None or not estop.engaged:
            return
        with self._changed:
            known = estop.id in self._heard.engagements
            if known or len(self._heard.engagements) < _MOST_VOICES:
                since_s = self._heard.held_since_s.get(estop.id, math.inf)
                self._heard.engagements[estop.id] = estop
                self._heard.held_since_s[estop.id] = min(since_s, _held_since_s(reply.ok))
            self._changed.notify_all()

    def _note_alive(self, reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            with self._changed:
                self._heard.alive.add(str(reply.ok.key_expr).split("/")[1])
                self._changed.notify_all()


def _held_since_s(answer: zenoh.Sample) -> float:
    """Monotonic time since which what is answered holds: later than the truth by the link's delay.

    Minus infinity where the one that answers does not tell.
    """
    with suppress(MessageError):
        if answer.attachment is not None:
            stamp = decode(Stamp, answer.attachment.to_bytes())
            return time.monotonic() - stamp.age_ns / 1e9
    return -math.inf


def _read(kind: type[MessageT], sample: zenoh.Sample) -> MessageT | None:
    with suppress(MessageError):
        return decode(kind, sample.payload.to_bytes(), str(sample.encoding))
    return None
