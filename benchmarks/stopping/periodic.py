"""A thread that does something so many times a second."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from threading import Event, Thread
from typing import Self

_END_S = 5.0
"""Longest wait for the thread, which only ever waits for its next turn."""


class Periodic(ABC):
    """Runs `run` in a thread while it is entered; `run` walks through `turns`."""

    def __init__(self) -> None:
        self._ending = Event()
        self._thread = Thread(target=self.run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        self._thread.join(_END_S)

    @abstractmethod
    def run(self) -> None:
        """What the thread does."""

    def turns(self, rate_hz: float) -> Iterator[int]:
        """0, 1, 2 and so on, each when it is due, until the end; what is late is made up for."""
        started_s, turn = time.monotonic(), 0
        while not self._ending.wait(max(0.0, started_s + turn / rate_hz - time.monotonic())):
            yield turn
            turn += 1
