"""Judging a stream of messages: which sender to believe, what is missing or malformed, its end."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from heel.schemas import (
    DriveState,
    EndOfStream,
    Header,
    HeelError,
    Message,
    MessageError,
    MotionCommand,
    Odometry,
    Ranges,
    Stamp,
    Taken,
    decode,
)
from heel.schemas.frame import FrameId
from heel.services.runtime.counters import ServiceStatistics
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.logs import OncePerSecond
from heel.services.runtime.qos import TopicQos
from heel.services.runtime.sequence import Name, SequenceWatch

SHARED_MEMORY_MIN_BYTES = 3072
"""Zenoh's default threshold: smaller messages go through the socket."""
PRODUCER_STALE_S = 0.5
"""A silent producer keeps its consumers this long before they move to another."""
FORMER_S = 10.0
"""A producer that was silent and is heard again so soon is listened to again: it was held up, not
replaced. Chosen by hand; stalls of 0.5 to 8 s were seen on busy machines."""
_MOST_RETURNS = 3
"""Times within `FORMER_S` that a producer gets its stream back: each may cost the one that stood in
`PRODUCER_STALE_S`. Chosen by hand."""
_RIVAL_S = 2.0
"""Seconds that a second sender is remembered and told of; chosen by hand."""
_REFUSED_S = 0.5
"""Nothing but refusals for so long is a problem."""
END_HOLD_S = 0.5
"""Nothing may follow an end for so long before it is believed."""
_UNSEEN_HOLD_S = 5.0
"""The same before the first frame: an end may be told while a camera is about to start."""

M = TypeVar("M", bound=Message)


class ProducerGate:
    """Stays with one producer until it is stale or gone, so that a swap is one clean cut.

    A producer that was only held up gets its stream back: otherwise one moment of a busy machine
    hands the stream for good to any sender beside it. It does so with a message that is new, and a
    few times in a while: neither a recording of it nor a last gasp now and then keeps out the one
    that stood in.
    """

    def __init__(self) -> None:
        self.current: str | None = None
        self._last_s = 0.0
        self._former: tuple[str, float] | None = None
        """The producer that may get the stream back, and when it was left."""
        self._line: tuple[str | None, int] = None, 0
        """Of the present producer, and its turn."""
        self._returned_s: deque[float] = deque([-math.inf] * _MOST_RETURNS, maxlen=_MOST_RETURNS)
        self._rivals: dict[str, float] = {}

    def accepts(
        self, producer: str, now_s: float, new: bool = True, line: str | None = None,
        turn: int = 0,
    ) -> bool:  # fmt: skip
        """Whether a message of this producer is to be used.

        Args:
            producer: its sender.
            now_s: monotonic time of its arrival.
            new: whether it was not there before: no old one gets its producer the stream back.
            line: the first of those that the sender has taken over from, if any.
            turn: how often that line has been taken over: one that has taken over from the present
                producer is believed at once.
        """
        own = line or producer, turn
        takes_over = own[0] == self._line[0] and turn > self._line[1]
        if takes_over or self.would_accept(producer, now_s, new):
            if producer != self.current:
                self._replace(producer, own[0], now_s)
            self._line = own
            self._last_s = now_s
            self._rivals.pop(producer, None)
            return True
        if producer in self._rivals or len(self._rivals) < 16:
            self._rivals[producer] = now_s
        return False

    def would_accept(self, producer: str, now_s: float, new: bool) -> bool:
        """The same without taking note of it."""
        stale = now_s - self._last_s > PRODUCER_STALE_S
        may_return = new and now_s - self._returned_s[0] >= FORMER_S
        return (
            self.current in (None, producer)
            or stale
            or (may_return and producer == self._elder(now_s))
        )

    def _elder(self, now_s: float) -> str | None:
        """The producer that may only be held up."""
        if self._former is None:
            return None
        name, left_s = self._former
        return name if now_s - left_s < FORMER_S else None

    def _replace(self, producer: str, line: str, now_s: float) -> None:
        elder = self._elder(now_s)
        if line == self._line[0]:
            # It goes on where the other one was: held up or not, that one is behind by now.
            self._former = None
        elif producer == elder:
            # It stays the elder: a stand-in does not get the stream back from it.
            self._former = None
            self._returned_s.append(now_s)
        elif elder is None and self.current is not None:
            # Nor does a second stand-in make the first one the elder.
            self._former = self.current, now_s
        self.current = producer

    def rivals(self, now_s: float) -> list[str]:
        """Other producers that were heard on the same stream of late."""
        self._rivals = {name: t for name, t in self._rivals.items() if now_s - t < _RIVAL_S}
        return sorted(self._rivals)


@dataclass(frozen=True, slots=True)
class Received(Generic[M]):
    """A message that was checked and accepted."""

    message: M
    stamp: Stamp
    arrived_s: float
    taken_s: float | None = None
    """When the frame was taken at the latest, on this process's monotonic clock, where known."""

    def age_s(self, now_s: float) -> float:
        """Age of the frame: what its producers report plus the monotonic time since arrival.

        Where it is known when the frame was taken, no less than the time since. Wall clocks are not
        used, so that a clock that jumps cannot make old data look new.
        """
        told_s = self.stamp.age_ns * 1e-9 + max(0.0, now_s - self.arrived_s)
        return told_s if self.taken_s is None else max(told_s, now_s - self.taken_s)


def _line_of(message: Message, producer: str) -> Name | None:
    """Within what a message counts; None if it does not."""
    if isinstance(message, FrameId | Taken):
        return message.epoch
    if isinstance(message, MotionCommand | Odometry | Ranges | DriveState):
        return producer
    return None


@dataclass
class StreamJudge:
    """Checks arrivals of one stream against its contract and keeps the books on it."""

    topic: str
    qos: TopicQos
    statistics: ServiceStatistics
    warn: OncePerSecond
    primary: bool = True
    """Whether gaps in this stream are the service's dropped frames."""
    live: bool = True
    """Whether messages may be lost; if not, every epoch is followed at once."""
    gate: ProducerGate = field(default_factory=ProducerGate)
    watch: SequenceWatch = field(init=False)
    unreadable: str = field(init=False, default="")
    """What was wrong with the last message, unless it was a rival's or nothing was."""
    unreadable_known: bool = field(init=False, default=False)
    """Whether that message named its sender, and was stamped later than all before: a sender that
    lives, and no replay."""
    _stamped_ns: int = field(init=False, default=0)
    _refused_since_s: float | None = field(init=False, default=None)
    _ending: tuple[EndOfStream, float, int] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.watch = SequenceWatch(self.live)

    def refuse(self, arrival: Arrival, error: HeelError) -> None:
        """Count a message that is malformed, or that the settings forbid; say so once a second."""
        self.statistics.malformed += 1
        self.warn.warning(f"{self.topic}-malformed", f"{arrival.key}: {error}", arrival.arrived_s)

    def end(self, arrival: Arrival) -> EndOfStream | None:
        """Decode an end-of-stream message; None if it is malformed or not of this stream."""
        try:
            end = decode(EndOfStream, arrival.payload, arrival.encoding)
            line = self.watch.line
            if isinstance(line, int) and (line != end.epoch or end.frames <= self.watch.seq):
                raise MessageError(
                    f"end: of epoch {end.epoch} after {end.frames} frames, but epoch {line} is at "
                    f"frame {self.watch.seq}: send it behind the last frame"
                )
        except MessageError as error:
            self.refuse(arrival, error)
            return None
        if self.primary:
            self.statistics.input_over = True
        return end

    def ending(self, arrival: Arrival) -> None:
        """Take an end-of-stream message; `ended` says when it is to be believed."""
        end = self.end(arrival)
        if end is not None:
            self._ending = end, arrival.arrived_s, self.watch.seq

    def ended(self, now_s: float) -> EndOfStream | None:
        """The end of the stream, once.

        It has to hold: an end is told behind the last frame on the same key, so one that frames
        follow was another sender's. Where nothing is lost, one right behind the last frame holds at
        once.
        """
        if self._ending is None:
            return None
        end, arrived_s, seq = self._ending
        if self.watch.seq != seq:
            self._ending = None
            self.warn.warning(f"{self.topic}-end", f"{self.topic}: an end that frames follow "
                              f"({end.reason[:80]!r}) is not believed", now_s)  # fmt: skip
            return None
        seen = self.watch.line is not None
        right_behind = seen and not self.live and end.frames == seq + 1
        hold_s = 0.0 if right_behind else END_HOLD_S if seen else _UNSEEN_HOLD_S
        if now_s - arrived_s < hold_s:
            return None
        self._ending = None
        return end

    def message(self, arrival: Arrival, kind: type[M], judged: bool = True) -> Received[M] | None:
        """Decode and judge a message with a `Stamp`; None if it is not to be used.

        Args:
            arrival: as it came.
            kind: the message expected.
            judged: False leaves it to the caller which sender to believe and what is new.
        """
        self.unreadable, self.unreadable_known, producer = "", False, None
        try:
            stamp = decode(Stamp, arrival.attachment or b"")
            producer = stamp.producer
            self.unreadable_known = stamp.t_sent_ns > self._stamped_ns
            self._stamped_ns = max(self._stamped_ns, stamp.t_sent_ns)
            self._check_size(arrival)
            message = decode(kind, arrival.payload, arrival.encoding)
        except MessageError as error:
            self.refuse(arrival, error)
            if producer is None or self.gate.would_accept(producer, arrival.arrived_s, False):
                self.unreadable = str(error)
            return None
        line = _line_of(message, stamp.producer) if judged else None
        if line is not None:
            seq: int = message.seq  # type: ignore[attr-defined]
            if not self._current(stamp.producer, line, seq, arrival, stamp):
                return None
        return Received(message, stamp, arrival.arrived_s)

    def header(self, arrival: Arrival) -> Header | None:
        """Decode and judge an image's header; None if the image is not to be used."""
        try:
            self._check_size(arrival)
            header = decode(Header, arrival.attachment or b"")
        except MessageError as error:
            self.refuse(arrival, error)
            return None
        current = self._current(header.producer, header.epoch, header.seq, arrival)
        return header if current else None

    def _check_size(self, arrival: Arrival) -> None:
        if arrival.size > self.qos.max_bytes:
            raise MessageError(
                f"{self.topic}: {arrival.size} bytes exceed the cap of {self.qos.max_bytes}: "
                "send less in one message"
            )
        if self.primary and arrival.size >= SHARED_MEMORY_MIN_BYTES:
            self.statistics.shared_memory = arrival.by_shared_memory

    def _current(
        self, producer: str, line: Name, seq: int, arrival: Arrival, stamp: Stamp | None = None
    ) -> bool:
        before = self.gate.current
        new = not self.watch.was_there(line, seq)
        began, turn = (None, 0) if stamp is None else (stamp.line, stamp.turn)
        accepted = self.gate.accepts(producer, arrival.arrived_s, new, began, turn)
        self.report_rivals(arrival)
        if not accepted:
            return False
        replaced = before is not None and before != producer
        fresh = self.watch.fresh(line, seq, arrival.arrived_s, replaced)
        # The newest one said again, as a last zero is, is no news; said for long it is a fault.
        again = (line, seq) == (self.watch.line, self.watch.seq)
        refusal = "" if fresh else f"{producer}: {self.watch.refusal}"
        self.report_refusal(arrival, refusal, aloud=not again)
        if fresh and self.primary:
            self.statistics.dropped = self.watch.missing
        return fresh

    def report_refusal(self, arrival: Arrival, refusal: str, aloud: bool = True) -> None:
        """Say in health when nothing but refused messages comes; no refusal clears it.

        Args:
            arrival: that was refused, or not.
            refusal: why; "" if it was taken.
            aloud: whether the log is to tell of a single one.
        """
        kind, now_s = f"refused-{self.topic}", arrival.arrived_s
        if not refusal:
            self._refused_since_s = None
            self.statistics.problem(kind, None)
            return
        if self._refused_since_s is None:
            self._refused_since_s = now_s
        lasts = now_s - self._refused_since_s > _REFUSED_S
        if aloud or lasts:
            self.warn.warning(kind, f"{arrival.key}: refused: {refusal}", now_s)
        if lasts:
            self.statistics.problem(
                kind, f"{arrival.key}: every message is refused: {refusal}", now_s + _RIVAL_S
            )

    def report_rivals(self, arrival: Arrival) -> None:
        """Say in health whether a second producer is heard, once the gate has judged."""
        now_s = arrival.arrived_s
        rivals = self.gate.rivals(now_s)
        reason = (
            f"two producers on {arrival.key}: {self.gate.current} (in use) and "
            f"{', '.join(rivals)}: stop one"
            if rivals
            else None
        )
        if self.statistics.problem(f"rivals-{self.topic}", reason, now_s + _RIVAL_S) and reason:
            self.warn.warning(f"rivals-{self.topic}", reason, now_s)
