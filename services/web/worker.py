"""A thread for work that may block, with a bound on what waits for it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from typing import TypeVar

from heel.schemas import HeelError

T = TypeVar("T")


class BusyError(HeelError):
    """So much waits already that nothing more is taken."""


class Worker:
    """Runs one piece of work after the other.

    Args:
        name: of the thread.
        max_waiting: pieces taken at most, the running one included.
        resources: ends the thread; what still blocks then is not waited for.
    """

    def __init__(self, name: str, max_waiting: int, resources: ExitStack) -> None:
        self._name = name
        self._places = threading.BoundedSemaphore(max_waiting)
        self._pool = ThreadPoolExecutor(1, thread_name_prefix=f"web-{name}")
        resources.callback(self._pool.shutdown, wait=False, cancel_futures=True)

    def submit(self, work: Callable[[], T]) -> Future[T]:
        """Take a piece of work; returns at once.

        Raises:
            BusyError: `max_waiting` pieces are not done yet.
        """
        if not self._places.acquire(blocking=False):
            raise BusyError(f"too many {self._name} requests are waiting: try again in a moment")
        future = self._pool.submit(work)
        future.add_done_callback(lambda _: self._places.release())
        return future
