"""Judging a stream of messages: which producer to believe, what is missing, what is malformed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Generic, TypeVar

from schemas import (
    EndOfStream,
    Header,
    Message,
    MessageError,
    Stamp,
    decode,
)
from schemas.frame import FrameId
from services.runtime.counters import ServiceStatistics
from services.runtime.inbox import Arrival
from services.runtime.logs import OncePerSecond
from services.runtime.qos import TopicQos

SHARED_MEMORY_MIN_BYTES = 3072
"""Zenoh's default threshold: smaller messages go through the socket."""
PRODUCER_STALE_S = 0.5
"""A silent producer keeps its consumers this long before they move to another."""
_RIVAL_S = 2.0
_MOST_MISSING = 2**63 - 1

M = TypeVar("M", bound=Message)


class ProducerGate:
    """Stays with one producer until it is stale or gone, so that a swap is one clean cut."""

    def __init__(self) -> None:
        self.current: str | None = None
        self._last_s = 0.0
        self._rivals: dict[str, float] = {}

    def accepts(self, producer: str, now_s: float) -> bool:
        """Whether a message of this producer is to be used."""
        stale = now_s - self._last_s > PRODUCER_STALE_S
        if self.current is None or producer == self.current or stale:
            self.current = producer
            self._last_s = now_s
            self._rivals.pop(producer, None)
            return True
        if producer in self._rivals or len(self._rivals) < 16:
            self._rivals[producer] = now_s
        return False

    def rivals(self, now_s: float) -> list[str]:
        """Other producers that were heard on the same stream of late."""
        self._rivals = {name: t for name, t in self._rivals.items() if now_s - t < _RIVAL_S}
        return sorted(self._rivals)


class SequenceWatch:
    """Counts what is missing from a stream, by its sequence numbers."""

    def __init__(self) -> None:
        self._epoch: int | None = None
        self._seq = -1
        self.missing = 0

    def fresh(self, frame: FrameId) -> bool:
        """Register a frame; False if it is not newer than the last one of its epoch."""
        if frame.epoch != self._epoch:
            self._epoch, self._seq = frame.epoch, frame.seq
            return True
        if frame.seq <= self._seq:
            return False
        self.missing = min(self.missing + frame.seq - self._seq - 1, _MOST_MISSING)
        self._seq = frame.seq
        return True


@dataclass(frozen=True, slots=True)
class Received(Generic[M]):
    """A message that was checked and accepted."""

    message: M
    stamp: Stamp
    arrived_s: float

    def age_s(self, now_s: float) -> float:
        """Age of the frame: what its producers report plus the monotonic time since arrival.

        Wall clocks are not used, so that a clock that jumps cannot make old data look new.
        """
        return self.stamp.age_ns * 1e-9 + max(0.0, now_s - self.arrived_s)


@dataclass
class StreamJudge:
    """Checks arrivals of one stream against its contract and keeps the books on it."""

    topic: str
    qos: TopicQos
    statistics: ServiceStatistics
    warn: OncePerSecond
    primary: bool = True
    """Whether gaps in this stream are the service's dropped frames."""
    gate: ProducerGate = field(default_factory=ProducerGate)
    watch: SequenceWatch = field(default_factory=SequenceWatch)

    def refuse(self, arrival: Arrival, error: MessageError) -> None:
        """Count a malformed message and say so, at most once a second."""
        self.statistics.malformed += 1
        self.warn.warning(f"{self.topic}-malformed", f"{arrival.key}: {error}", arrival.arrived_s)

    def end(self, arrival: Arrival) -> EndOfStream | None:
        """Decode an end-of-stream message; None if it is malformed."""
        try:
            end = decode(EndOfStream, arrival.payload, arrival.encoding)
        except MessageError as error:
            self.refuse(arrival, error)
            return None
        if self.primary:
            self.statistics.input_over = True
        return end

    def message(self, arrival: Arrival, kind: type[M]) -> Received[M] | None:
        """Decode and judge a message with a `Stamp`; None if it is not to be used."""
        try:
            self._check_payload(arrival)
            stamp = decode(Stamp, arrival.attachment or b"")
            message = decode(kind, arrival.payload, arrival.encoding)
        except MessageError as error:
            self.refuse(arrival, error)
            return None
        if isinstance(message, FrameId) and not self._current(stamp.producer, message, arrival):
            return None
        return Received(message, stamp, arrival.arrived_s)

    def header(self, arrival: Arrival) -> Header | None:
        """Decode and judge an image's header; None if the image is not to be used."""
        try:
            self._check_payload(arrival)
            header = decode(Header, arrival.attachment or b"")
        except MessageError as error:
            self.refuse(arrival, error)
            return None
        return header if self._current(header.producer, header, arrival) else None

    def _check_payload(self, arrival: Arrival) -> None:
        if arrival.size > self.qos.max_bytes:
            raise MessageError(
                f"{self.topic}: {arrival.size} bytes exceed the cap of {self.qos.max_bytes}: "
                "send less in one message"
            )
        if self.primary and arrival.size >= SHARED_MEMORY_MIN_BYTES:
            self.statistics.shared_memory = arrival.by_shared_memory

    def _current(self, producer: str, frame: FrameId, arrival: Arrival) -> bool:
        accepted = self.gate.accepts(producer, arrival.arrived_s)
        self.report_rivals(arrival)
        if not accepted or not self.watch.fresh(frame):
            return False
        if self.primary:
            self.statistics.dropped = self.watch.missing
        return True

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
        if self.statistics.problem(f"rivals-{self.topic}", reason) and reason:
            self.warn.warning(f"rivals-{self.topic}", reason, now_s)
