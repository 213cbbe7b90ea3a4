"""A range sensor that can fall silent: nothing within ten metres, all around, 20 times a second."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from threading import Event, Thread
from typing import Self

from heel.schemas import Ranges, RangeSector

_RATE_HZ = 20.0
_SECTORS = 12
_FREE_M = 10.0


class RangeSensor:
    """Publishes from a thread while `silent` is false. Use as a context manager.

    Args:
        publish: sends one message with its stamp.
        publish_spoilt: sends the same in a way that nobody can read.
    """

    def __init__(
        self, publish: Callable[[Ranges], None], publish_spoilt: Callable[[Ranges], None]
    ) -> None:
        self.silent = False
        self.spoilt = False
        self._publish_spoilt = publish_spoilt
        self._publish = publish
        self._ending = Event()
        self._thread = Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        self._thread.join(5.0)

    def _run(self) -> None:
        width_rad = 2.0 * math.pi / _SECTORS
        sectors = tuple(
            RangeSector(
                bearing_rad=math.remainder(number * width_rad, 2.0 * math.pi),
                width_rad=width_rad, distance_m=_FREE_M,
            )
            for number in range(_SECTORS)
        )  # fmt: skip
        started_s, seq = time.monotonic(), 0
        while not self._ending.wait(max(0.0, started_s + seq / _RATE_HZ - time.monotonic())):
            seq += 1
            if not self.silent:
                publish = self._publish_spoilt if self.spoilt else self._publish
                publish(Ranges(seq=seq, sectors=sectors))
