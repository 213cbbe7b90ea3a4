"""Waiting until the services of a run are there."""

from __future__ import annotations

import threading
import time

import zenoh

from heel.schemas import HeelError, keys
from heel.services.run.children import Children

_START_TIMEOUT_S = 60.0
_POLL_S = 0.1


def await_present(
    session: zenoh.Session, children: Children, wanted: set[str], stop: threading.Event
) -> None:
    """Wait until every service has subscribed: a frame sent earlier would be lost.

    Raises:
        HeelError: one of them ended, or is not up in time.
    """
    present: set[str] = set()
    changed = threading.Event()

    def seen(sample: zenoh.Sample) -> None:
        present.add(str(sample.key_expr).split("/")[1])
        changed.set()

    watch = session.liveliness().declare_subscriber(keys.ALL_ALIVE, seen, history=True)
    deadline_s = time.monotonic() + _START_TIMEOUT_S
    while not present >= wanted and not stop.is_set():
        changed.wait(_POLL_S)
        changed.clear()
        if (failure := children.failure()) is not None:
            raise failure
        if time.monotonic() > deadline_s:
            missing = ", ".join(sorted(wanted - present))
            raise HeelError(
                f"{missing} not up within {_START_TIMEOUT_S:g} s: is the machine very busy?"
            )
    watch.undeclare()  # type: ignore[no-untyped-call]
