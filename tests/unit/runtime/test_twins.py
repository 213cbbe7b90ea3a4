"""Two drives or two followers at once are said by both."""

from __future__ import annotations

import logging
import time
from contextlib import ExitStack

import zenoh

from heel.schemas import Progress
from heel.services.runtime import qos
from heel.services.runtime.counters import ServiceStatistics
from heel.services.runtime.publishing import StreamPublisher
from heel.services.runtime.twins import TwinWatch
from tests.support.network import wait_until

_ONE, _OTHER = "drive/main@00000001", "drive/main@00000002"


def test_another_sender_is_named_while_it_is_heard(
    sender: zenoh.Session, receiver: zenoh.Session
) -> None:
    statistics, message = ServiceStatistics(), Progress(stream="front", epoch=1, seq=0)
    with ExitStack() as resources:
        log = logging.getLogger("heel.test")
        TwinWatch(receiver, "twins/out", _ONE, statistics, log, resources)
        own = StreamPublisher(receiver, "twins/out", qos.DRIVE, "live", _ONE)
        other = StreamPublisher(sender, "twins/out", qos.DRIVE, "live", _OTHER)
        own.send(message, 0.0)
        wait_until(lambda: other.has_listeners, "the watch")
        assert statistics.problems() == [], "its own messages are nobody else's"

        def named() -> bool:
            other.send(message, 0.0)
            time.sleep(0.05)
            return bool(statistics.problems())

        wait_until(named, "the other one")
        assert statistics.problems() == [f"two on twins/out: {_ONE} and {_OTHER}: stop one drive"]
        assert statistics.problems(time.monotonic() + 3.0) == []
