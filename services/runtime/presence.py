"""What a service knows of the others without a word from them: the bus, and which are there."""

from __future__ import annotations

import threading
import time

import zenoh

from heel.schemas import keys
from heel.services.runtime.chain import CHAIN

_GONE_AFTER_S = 0.4
"""A token that comes back sooner was a connection made anew."""
_BACK_S = 2.0
"""How long after the bus is back a part may take to be back, too: clients try once a second."""


def connected(session: zenoh.Session) -> bool:
    """Whether a router, or in peer mode any peer, is connected at present."""
    info = session.info
    return bool(info.routers_zid() or info.peers_zid())


class Presence:
    """Remembers which parts of the chain were there and have gone, while this process runs.

    Args:
        session: of this process; its tokens are watched until the session ends.
    """

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._lock = threading.Lock()
        self._there: dict[str, set[str]] = {}
        self._gone_s: dict[str, float] = {}
        self._was_connected = False
        self._back_s = float("-inf")
        self._watch = session.liveliness().declare_subscriber(
            keys.ALL_ALIVE, self._changed, history=True
        )

    def close(self) -> None:
        """Watch no longer."""
        self._watch.undeclare()  # type: ignore[no-untyped-call]

    def bus_away(self, now_s: float) -> bool:
        """Whether the router was there and is not; ask regularly."""
        there = connected(self._session)
        if there and not self._was_connected:
            self._back_s = now_s
        away = self._was_connected and not there
        self._was_connected = there or self._was_connected
        if away:
            self._back_s = float("inf")
        elif self._back_s == float("inf"):
            self._back_s = now_s
        return away

    def missing(self, now_s: float) -> list[str]:
        """Parts of the chain that have gone and not come back, in the chain's order."""
        if now_s - self._back_s < _BACK_S:
            return []
        with self._lock:
            return [service for service in CHAIN
                    if now_s - self._gone_s.get(service, now_s) > _GONE_AFTER_S]  # fmt: skip

    def _changed(self, sample: zenoh.Sample) -> None:
        _, service, instance = str(sample.key_expr).split("/")
        if service not in CHAIN:
            return
        with self._lock:
            there = self._there.setdefault(service, set())
            if sample.kind == zenoh.SampleKind.PUT:
                there.add(instance)
            else:
                there.discard(instance)
            if there:
                self._gone_s.pop(service, None)
            else:
                self._gone_s.setdefault(service, time.monotonic())
