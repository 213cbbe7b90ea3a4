from __future__ import annotations

import threading
from contextlib import ExitStack

import pytest

from heel.services.web.worker import BusyError, Worker


def test_takes_no_more_than_it_may_and_then_again() -> None:
    go_on = threading.Event()
    with ExitStack() as resources:
        resources.callback(go_on.set)
        worker = Worker("stop", 2, resources)
        first, second = worker.submit(lambda: go_on.wait(10)), worker.submit(lambda: 2)
        with pytest.raises(BusyError, match="stop"):
            worker.submit(lambda: 3)
        go_on.set()
        assert first.result(10)
        assert second.result(10) == 2
        assert worker.submit(lambda: 4).result(10) == 4


def test_does_not_wait_for_what_blocks() -> None:
    go_on = threading.Event()
    with ExitStack() as resources:
        worker = Worker("stop", 2, resources)
        blocked = worker.submit(lambda: go_on.wait(10))
        waiting = worker.submit(lambda: 2)
    assert not blocked.done()
    assert waiting.cancelled()
    go_on.set()
