"""Bounded mailboxes between Zenoh's threads and a service's one loop.

Each topic has a ring: when the loop is behind, the oldest message goes, never the link.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import zenoh
from zenoh.handlers import Handler, RingChannel

from heel.services.runtime.qos import TopicQos

_Subscriber = zenoh.Subscriber[Handler[zenoh.Sample]]


@dataclass(frozen=True, slots=True)
class Arrival:
    """A message as it came off the wire, not yet believed."""

    topic: str
    """The receiver's own name for the subscription."""
    key: str
    sample: zenoh.Sample
    arrived_s: float
    """Monotonic seconds."""

    @property
    def size(self) -> int:
        """Payload bytes, without copying them."""
        return len(self.sample.payload)

    @property
    def payload(self) -> bytes:
        """A copy of the payload (Zenoh's Python binding has no other way, 0.1 ms per MB)."""
        return self.sample.payload.to_bytes()

    @property
    def attachment(self) -> bytes | None:
        """The attachment, if there is one."""
        attachment = self.sample.attachment
        return None if attachment is None else attachment.to_bytes()

    @property
    def encoding(self) -> str:
        """The encoding string."""
        return str(self.sample.encoding)

    @property
    def by_shared_memory(self) -> bool:
        """Whether the payload came through shared memory rather than a socket."""
        return self.sample.payload.as_shm() is not None


class Inbox:
    """Subscriptions of one service, read by one loop.

    Use as a context manager: leaving it undeclares every subscription and ends its threads.
    """

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._ready = threading.Condition()
        self._interrupted = False
        self._rings: dict[str, deque[Arrival]] = {}
        self._pumps: list[tuple[str, _Subscriber, threading.Thread]] = []
        self._changing = threading.Lock()
        self._closed = False
        self.overflowed: dict[str, int] = {}
        """Messages that gave way to newer ones, per topic."""

    def __enter__(self) -> Inbox:
        return self

    def __exit__(self, *error: object) -> None:
        with self._changing:
            self._closed = True
        for _, subscriber, _ in self._pumps:
            subscriber.undeclare()  # type: ignore[no-untyped-call]
        for _, _, thread in self._pumps:
            thread.join(timeout=1.0)

    def subscribe(
        self, topic: str, key: str, qos: TopicQos, told: Callable[[Arrival], None] | None = None
    ) -> None:
        """Receive `key` under the name `topic`.

        Args:
            topic: the receiver's own name for it.
            key: an expression.
            qos: of the topic.
            told: called of every arrival, in the thread that receives, past the ring.
        """
        subscriber = self._session.declare_subscriber(key, RingChannel(qos.capacity))
        self._keep(topic, subscriber, qos.capacity, qos.max_bytes, told)

    def move(
        self, topic: str, key: str, qos: TopicQos, told: Callable[[Arrival], None] | None = None
    ) -> None:
        """As `subscribe`, in place of what `topic` was before; what waits in its ring stays."""
        with self._changing:
            if self._closed:
                return
            former = [pump for pump in self._pumps if pump[0] == topic]
            self._pumps = [pump for pump in self._pumps if pump[0] != topic]
            self.subscribe(topic, key, qos, told)
        for _, subscriber, _ in former:
            subscriber.undeclare()  # type: ignore[no-untyped-call]

    def hear(self, key: str, qos: TopicQos, take: Callable[[Arrival], None]) -> None:
        """Pass what comes on `key` to `take`, in a thread of its own and past every ring.

        `take` may use the session, which a callback of Zenoh's may not.
        """
        subscriber = self._session.declare_subscriber(key, RingChannel(qos.capacity))

        def pass_on() -> None:
            for sample in subscriber:
                take(Arrival(key, str(sample.key_expr), sample, time.monotonic()))

        self._start(key, subscriber, pass_on)

    def subscribe_alive(self, topic: str, key: str, capacity: int = 64) -> None:
        """Receive liveliness tokens, those that are there already included, as `topic`."""
        liveliness = self._session.liveliness()
        tokens = liveliness.declare_subscriber(key, RingChannel(capacity), history=True)
        self._keep(topic, tokens, capacity, 0)

    def _keep(
        self, topic: str, subscriber: _Subscriber, capacity: int, max_bytes: int,
        told: Callable[[Arrival], None] | None = None,
    ) -> None:  # fmt: skip
        self._rings.setdefault(topic, deque(maxlen=capacity))
        self.overflowed.setdefault(topic, 0)
        self._start(topic, subscriber, lambda: self._pump(topic, subscriber, max_bytes, told))

    def _start(self, topic: str, subscriber: _Subscriber, work: Callable[[], None]) -> None:
        thread = threading.Thread(target=work, name=f"inbox-{topic}", daemon=True)
        self._pumps.append((topic, subscriber, thread))
        thread.start()

    def _pump(
        self, topic: str, subscriber: _Subscriber, max_bytes: int,
        told: Callable[[Arrival], None] | None,
    ) -> None:  # fmt: skip
        ring = self._rings[topic]
        # Iteration ends by itself when the subscriber is undeclared (measured).
        for sample in subscriber:
            arrival = Arrival(topic, str(sample.key_expr), sample, time.monotonic())
            with self._ready:
                if arrival.size > max_bytes:
                    # One is enough to say so: a ring of them would hold up to 1 GB.
                    for older in [one for one in ring if one.size > max_bytes]:
                        ring.remove(older)
                        self.overflowed[topic] += 1
                if len(ring) == ring.maxlen:
                    self.overflowed[topic] += 1
                ring.append(arrival)
                self._ready.notify_all()
            if told is not None:
                told(arrival)

    def interrupt(self) -> None:
        """End the wait of `get`, or of the next one: something came another way."""
        with self._ready:
            self._interrupted = True
            self._ready.notify_all()

    def get(self, timeout_s: float, *topics: str) -> Arrival | None:
        """Take the message that waits longest, or None after `timeout_s` or an interruption.

        Args:
            timeout_s: deadline of the wait; 0 only looks.
            topics: look at these only; none given means all.
        """
        rings = [self._rings[topic] for topic in (topics or self._rings)]
        deadline_s = time.monotonic() + timeout_s
        with self._ready:
            while True:
                waiting = [ring for ring in rings if ring]
                if waiting:
                    return min(waiting, key=lambda ring: ring[0].arrived_s).popleft()
                if self._interrupted:
                    self._interrupted = False
                    return None
                remaining_s = deadline_s - time.monotonic()
                if remaining_s <= 0 or not self._ready.wait(remaining_s):
                    return None

    def all_of(self, timeout_s: float, *topics: str) -> Iterator[Arrival]:
        """What waits, the oldest first, or what comes within `timeout_s`; arguments as of `get`."""
        while (arrival := self.get(timeout_s, *topics)) is not None:
            timeout_s = 0.0
            yield arrival

    def latest(self, topic: str) -> Arrival | None:
        """Take the newest message of one topic and forget the older ones."""
        with self._ready:
            ring = self._rings[topic]
            newest = ring.pop() if ring else None
            self.overflowed[topic] += len(ring)
            ring.clear()
        return newest
