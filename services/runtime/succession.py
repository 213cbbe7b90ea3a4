"""One process of a kind sends, others stand by; they take over from each other without a gap.

The one that sends answers for its state and hands over on request; it steps back once it hears
that another one has gone on with its line. Each message names the line that its sender goes on
with (`Stamp`), so that receivers know the same ids by whichever process they come.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from typing import NamedTuple

import zenoh

from heel.schemas import Handover, HeelError, MessageError, Snapshot, Stamp, decode, encode, keys
from heel.services.runtime.asking import EVERY_ANSWER, EVERYBODY, Question, refusal
from heel.services.runtime.publishing import StreamPublisher
from heel.services.runtime.streams import PRODUCER_STALE_S

READY, NOT_READY = "ready", "not ready"
"""How what health tells of a process that stands by begins."""
_FIRST_S = 2.0
"""Time [s] for which a process that stands by waits for another one to be heard at all; chosen by
hand: longer than the first frame of a service takes."""
_STALL_S = 0.3
"""Seconds between two looks from which this process was held up itself; it looks every 0.05 s."""
_GONE_S = 0.15
"""Seconds without an answer of one whose token is gone as well; its last messages may still be on
their way. Chosen by hand."""
_NOT_READY_S = 3.0
"""The same of one that is there, where this one is not ready: longer than a busy machine holds a
process up, as people would get new ids. Chosen by hand."""
HELD_UP_S = 0.7
"""A loop that has not come round for longer may have been replaced meanwhile; it comes round every
0.2 s at least."""
_LISTEN_S = 0.3
"""Seconds that such a one listens before it sends: some frames of its successor; chosen by hand."""
_MOST_ASKED = 4
"""Questions for the state that wait for the end of a frame; chosen by hand."""
_ANSWER_S = 1.0
"""Longest wait [s] for a state, which takes milliseconds; chosen by hand."""
_ASK_PERIOD_S = 0.5
"""Seconds between two questions for it; chosen by hand."""


class Line(NamedTuple):
    """What a process goes on with.

    Attributes:
        began: the process that began it.
        turn: how often it has been taken over.
    """

    began: str
    turn: int


class Succession:
    """The part of a process that sends, and its end.

    Args:
        session: of the process.
        out: its own stream, whose messages name the line.
        key: of that stream.
        names: kind of process, camera, and the process itself.
        resources: end what is declared here.
        log: of the service.
    """

    def __init__(
        self, session: zenoh.Session, out: StreamPublisher, key: str,
        names: tuple[str, str, str], resources: ExitStack, log: logging.Logger,
    ) -> None:  # fmt: skip
        self._session, self._out, self._log = session, out, log
        self._service, self._camera, self._producer = names
        self._lock = threading.Lock()
        self._leads = self._yields = False
        self._told: str | None = None
        self._replaced_by: str | None = None
        self._asked: deque[zenoh.Query] = deque()
        self._turn_s: float | None = None
        self._queryables: list[zenoh.Queryable[None]] = []
        watch = session.declare_subscriber(key, self._hear, allowed_origin=zenoh.Locality.REMOTE)
        resources.callback(watch.undeclare)
        resources.callback(self.step_back)

    @property
    def line(self) -> Line:
        """Of this process's messages."""
        return Line(self._out.line or self._producer, self._out.turn)

    def lead(self, line: Line | None, state: bool, yields: bool = False) -> None:
        """Send from now on.

        Args:
            line: that this process goes on with; None: it begins one.
            state: whether it has a state that others can ask for.
            yields: whether to step back for anybody that sends, of this line or not.
        """
        with self._lock:
            begun = line is None or line.began == self._producer
            self._out.line = None if line is None or begun else line.began
            self._out.turn = 0 if line is None else line.turn
            self._told = self._replaced_by = self._turn_s = None
            self._leads, self._yields = True, yields
        handover = keys.handover(self._camera, self._service)
        self._queryables.append(self._session.declare_queryable(handover, self._take_handover))
        if state:
            snapshot = keys.snapshot(self._camera, self._service)
            self._queryables.append(self._session.declare_queryable(snapshot, self._take_question))

    def step_back(self) -> None:
        """Send no longer."""
        with self._lock:
            self._leads = False
            asked, self._asked = list(self._asked), deque()
        for query in asked:
            with query:
                query.reply_err("another one sends from now on: ask again")
        for queryable in self._queryables:
            queryable.undeclare()  # type: ignore[no-untyped-call]
        self._queryables.clear()

    def may_send(self, stopped: Callable[[float], bool]) -> bool:
        """Ask before each message, and in each turn without one; False once another one sends.

        Args:
            stopped: waits so many seconds, and tells whether the process is to end.
        """
        now_s = time.monotonic()
        held_up = self._turn_s is not None and now_s - self._turn_s > HELD_UP_S
        self._turn_s = now_s
        if held_up and self._replaced_by is None:
            stopped(_LISTEN_S)
            self._turn_s = time.monotonic()
        if self._replaced_by is not None:
            self._log.warning("%s has taken over meanwhile: this one stands by", self._replaced_by)
            return False
        return True

    def successor(self) -> str | None:
        """Whom to name in the message that is about to be sent; this process's last one then."""
        with self._lock:
            told, self._told = self._told, None
        if told is not None:
            self._log.info("handing over to %s", told)
        return told

    def answer(self, snapshot: Callable[[], Snapshot | None]) -> None:
        """Between two frames: give the state to those that have asked for it."""
        while self._asked:
            with self._asked.popleft() as query:
                try:
                    state = snapshot()
                    if state is None:
                        raise HeelError("there is no state yet: ask again")
                    key = keys.snapshot(self._camera, self._service)
                    query.reply(key, encode(state), encoding=state.encoding())
                except HeelError as error:
                    query.reply_err(str(error), encoding=zenoh.Encoding.TEXT_PLAIN)

    def _take_question(self, query: zenoh.Query) -> None:
        if self._leads and len(self._asked) < _MOST_ASKED:
            self._asked.append(query)
            return
        with query:
            query.reply_err("too many ask for the state at once: ask again later")

    def _take_handover(self, query: zenoh.Query) -> None:
        with query:
            try:
                if query.payload is None:
                    raise HeelError("name the successor: `heel swap` does")
                successor = decode(Handover, query.payload.to_bytes()).successor
                kind = successor.partition("/")[0]
                if kind != self._service:
                    raise HeelError(f"{successor} is a {kind}, not a {self._service}")
            except HeelError as error:
                query.reply_err(str(error), encoding=zenoh.Encoding.TEXT_PLAIN)
                return
            with self._lock:
                self._told = successor if successor != self._producer else None
            query.reply(
                keys.handover(self._camera, self._service), self._producer,
                encoding=zenoh.Encoding.TEXT_PLAIN,
            )  # fmt: skip

    def _hear(self, sample: zenoh.Sample) -> None:
        """Another process sends on this key; one of this line has taken over."""
        if not self._leads or sample.attachment is None:
            return
        try:
            stamp = decode(Stamp, sample.attachment.to_bytes())
        except MessageError:
            # Who obeys this stream refuses it as well, and says so.
            return
        if stamp.producer == self._producer:
            return
        own = self.line
        # Of two that take over at the same moment one has to give way.
        later = (stamp.turn, stamp.producer) > (own.turn, self._producer)
        if self._yields or (stamp.origin == own.began and later):
            self._replaced_by = stamp.producer


class StandingBy:
    """When a process that stands by has to take over, and which line to go on with.

    Attributes:
        line: that it would go on with; None: no process that sends has been heard.
        why: it is time to take over; empty: it is not.
    """

    def __init__(self, session: zenoh.Session, producer: str, resources: ExitStack) -> None:
        """Stand by from now on.

        Args:
            session: of the process.
            producer: its name.
            resources: end the watch for others of its kind.
        """
        self.line: Line | None = None
        self.why = ""
        self._producer = producer
        self._service, _, own = producer.partition("@")[0].partition("/")
        self._there: set[str] = {own}
        self._begun_s = self._looked_s = self._back_s = time.monotonic()
        self._own = own
        watch = session.liveliness().declare_subscriber(
            f"alive/{self._service}/*", self._token, history=True
        )
        resources.callback(watch.undeclare)
        self._heard_s: float | None = None
        self._leader = ""

    def _token(self, sample: zenoh.Sample) -> None:
        instance = str(sample.key_expr).rpartition("/")[2]
        there = self._there | {instance}
        self._there = there if sample.kind == zenoh.SampleKind.PUT else there - {instance}

    def hear(self, stamp: Stamp, arrived_s: float) -> None:
        """A message of the process that sends."""
        self._leader, self.line = stamp.producer, Line(stamp.origin, stamp.turn + 1)
        self._heard_s = arrived_s
        if stamp.successor == self._producer:
            self.why = f"{stamp.producer} hands over"

    def is_due(self, unanswered_s: float | None, ready: bool) -> bool:
        """Whether it is time: told to, or input comes and nothing of it.

        Args:
            unanswered_s: when the oldest input came to which there is no answer; None: all have.
            ready: whether this one can go on without a loss; else the other one gets more time.
        """
        if self.why:
            return True
        now_s = time.monotonic()
        if now_s - self._looked_s > _STALL_S:
            # This process was held up, and knows nothing of the others meanwhile.
            self._back_s = now_s
        self._looked_s = now_s
        if unanswered_s is None:
            return False
        if self._heard_s is None:
            waited_s = min(now_s - self._begun_s, now_s - unanswered_s, now_s - self._back_s)
            if waited_s > self._first_s():
                self.why = f"no {self._service} sends"
            return bool(self.why)
        silent_s = min(now_s - self._heard_s, now_s - unanswered_s, now_s - self._back_s)
        gone = self._leader.partition("@")[0].partition("/")[2] not in self._there
        longest_s = _GONE_S if gone else PRODUCER_STALE_S if ready else _NOT_READY_S
        if silent_s > longest_s:
            how = "gone" if gone else f"silent for {silent_s:.1f} s"
            self.why = f"{self._leader} is {how}"
        return bool(self.why)

    def _first_s(self) -> float:
        """Longest wait [s] for a first message, where input comes.

        Others that are there may stand by as well: then they go one after the other, by their
        names, or each would wait for all the others.
        """
        others = self._there - {self._own}
        if not others:
            return _FIRST_S
        return _NOT_READY_S + _FIRST_S * sum(other < self._own for other in others)

    def told(self, ready: bool, why_not: str) -> str:
        """For health: whether it could take over without a loss."""
        if not self._leader:
            return f"{NOT_READY}: no {self._service} is heard yet"
        if ready:
            return f"{READY}: in step with {self._leader}"
        return f"{NOT_READY} for {self._leader}: {why_not}"[:200]


class SnapshotQuestion:
    """Asks the process that sends for its state, without ever waiting.

    Args:
        session: of the process.
        key: of the state.
    """

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self._session, self._key = session, key
        self._question: Question | None = None
        self._asked_s = -_ASK_PERIOD_S
        self.refusal = ""
        """Why there is none, as the one that was asked says."""

    def poll(self, now_s: float) -> Snapshot | None:
        """The state, if an answer has come; asks every half second until one does.

        Raises:
            MessageError: the answer is no snapshot.
        """
        if self._question is None:
            if now_s - self._asked_s < _ASK_PERIOD_S:
                return None
            self._asked_s = now_s
            self._question = Question(self._session, self._key, _ANSWER_S)
        for reply in self._question.replies():
            if reply.ok is not None:
                self._question = None
                return decode(Snapshot, reply.ok.payload.to_bytes(), str(reply.ok.encoding))
            self.refusal = refusal(reply) or ""
        if self._question.over:
            self._question = None
        return None


def leads_already(session: zenoh.Session, key: str) -> bool:
    """Whether a process answers for its state, waiting for a second at most."""
    replies = session.get(key, target=EVERYBODY, consolidation=EVERY_ANSWER, timeout=_ANSWER_S)
    return any(reply.ok is not None or refusal(reply) is not None for reply in replies)
