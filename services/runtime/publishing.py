"""Sending: a publisher per topic with its QoS, and latched values that late joiners ask for."""

from __future__ import annotations

import threading
import time

import zenoh
from zenoh.shm import ZShmMut

from heel.schemas import EndOfStream, Message, Stamp, encode
from heel.schemas.base import MAX_AGE_NS
from heel.services.runtime.qos import Delivery, TopicQos


class StreamPublisher:
    """Sends one stream: results with a `Stamp`, and at last the end of the stream."""

    def __init__(
        self, session: zenoh.Session, key: str, qos: TopicQos, delivery: Delivery, producer: str
    ) -> None:
        qos = qos.for_delivery(delivery)
        self._producer = producer
        self.line: str | None = None
        """Of the process that this one has taken over from, if any; see `Stamp`."""
        self.turn = 0
        """How often that line has been taken over."""
        self._publisher = session.declare_publisher(
            key,
            priority=qos.priority,
            congestion_control=qos.congestion,
            express=qos.express,
            reliability=qos.reliability,
        )
        # The end must not be dropped, and being of the same priority it cannot overtake.
        self._ending = session.declare_publisher(
            key,
            priority=qos.priority,
            congestion_control=zenoh.CongestionControl.BLOCK,
            express=qos.express,
        )

    def send(self, message: Message, age_s: float, successor: str | None = None) -> None:
        """Send a message about a frame that is `age_s` old by now.

        Args:
            message: to be sent.
            age_s: of its frame.
            successor: who sends from the next message on.
        """
        age_ns = min(max(0, round(age_s * 1e9)), MAX_AGE_NS)
        stamp = Stamp(
            producer=self._producer, t_sent_ns=time.time_ns(), age_ns=age_ns, line=self.line,
            turn=self.turn, successor=successor,
        )  # fmt: skip
        self.send_bytes(encode(message), message.encoding(), encode(stamp))

    def send_bytes(self, payload: bytes | ZShmMut, encoding: str, attachment: bytes) -> None:
        """Send bytes that are coded already."""
        self._publisher.put(payload, encoding=encoding, attachment=attachment)

    def end(self, message: EndOfStream) -> None:
        """Announce that nothing more follows in this epoch."""
        self._ending.put(encode(message), encoding=message.encoding())

    @property
    def has_listeners(self) -> bool:
        """Whether there is a subscriber to this key at present."""
        # The stub promises a bool; the binding gives an object, and objects are true (zenoh 1.10).
        status = self._publisher.matching_status
        return bool(getattr(status, "matching", status))


class Latched:
    """A value whose changes are published and whose present can be asked for, on one key.

    Plain publisher plus queryable: stable Zenoh API, no timestamps needed, small access rules.

    Args:
        session: the service's session.
        key: of the value.
        qos: of its changes.
        producer: answers carry a `Stamp` of this process, whose age is the time for which the
            value has held here; "" for none.
    """

    def __init__(self, session: zenoh.Session, key: str, qos: TopicQos, producer: str = "") -> None:
        self._key = key
        self._producer = producer
        self._lock = threading.Lock()
        self._current: Message | None = None
        self._since_s = time.monotonic()
        self._publisher = session.declare_publisher(
            key, priority=qos.priority, congestion_control=qos.congestion, express=qos.express
        )
        self._queryable = session.declare_queryable(key, self._answer)

    def _answer(self, query: zenoh.Query) -> None:
        with self._lock:
            current, held_s = self._current, time.monotonic() - self._since_s
        with query:
            if current is None:
                return
            stamp = None if not self._producer else encode(Stamp(
                producer=self._producer, t_sent_ns=time.time_ns(),
                age_ns=min(round(held_s * 1e9), MAX_AGE_NS),
            ))  # fmt: skip
            query.reply(
                self._key, encode(current), encoding=current.encoding(), attachment=stamp
            )  # fmt: skip

    def set(self, message: Message) -> None:
        """Publish a new value and keep it for late joiners."""
        self.keep(message)
        self._publisher.put(encode(message), encoding=message.encoding())

    def keep(self, message: Message | None) -> None:
        """Answer with this value from now on, or not; another process has published it."""
        with self._lock:
            if message != self._current:
                self._current, self._since_s = message, time.monotonic()

    def __enter__(self) -> Latched:
        return self

    def __exit__(self, *_: object) -> None:
        self._queryable.undeclare()  # type: ignore[no-untyped-call]
        self._publisher.undeclare()  # type: ignore[no-untyped-call]
