"""Two of what there may be one of: a robot has one set of wheels and one follower."""

from __future__ import annotations

import logging
import time
from contextlib import ExitStack

import zenoh

from heel.schemas import MessageError, Stamp, decode
from heel.services.runtime.counters import ServiceStatistics
from heel.services.runtime.logs import OncePerSecond

_LOOK_S = 0.2
"""However many messages another one sends, one in so long is looked at."""
_LASTS_S = 2.0
"""Seconds that health tells of a twin after its last message; chosen by hand."""


class TwinWatch:
    """Hears whether another process sends what this service sends, and says so in health.

    Args:
        session: the service's; what it sends itself is not heard.
        key: of its own stream.
        producer: its name.
        statistics: of the service.
        log: of the service.
        resources: end the subscription.
    """

    def __init__(
        self, session: zenoh.Session, key: str, producer: str, statistics: ServiceStatistics,
        log: logging.Logger, resources: ExitStack,
    ) -> None:  # fmt: skip
        self._key, self._producer = key, producer
        self._statistics, self._warn = statistics, OncePerSecond(log)
        self._looked_s = 0.0
        subscriber = session.declare_subscriber(
            key, self._hear, allowed_origin=zenoh.Locality.REMOTE
        )
        resources.callback(subscriber.undeclare)

    def _hear(self, sample: zenoh.Sample) -> None:
        now_s = time.monotonic()
        if now_s - self._looked_s < _LOOK_S or sample.attachment is None:
            return
        self._looked_s = now_s
        try:
            other = decode(Stamp, sample.attachment.to_bytes()).producer
        except MessageError:
            # A service that obeys this stream refuses it as well, and says so.
            return
        if other == self._producer:
            return
        service = self._producer.partition("/")[0]
        reason = f"two on {self._key}: {self._producer} and {other}: stop one {service}"
        if self._statistics.problem(f"twin-{self._key}", reason, now_s + _LASTS_S):
            self._warn.warning(self._key, reason, now_s)
