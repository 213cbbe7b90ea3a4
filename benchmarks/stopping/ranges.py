"""A range sensor that can fall silent: nothing within ten metres, all around, 20 times a second."""

from __future__ import annotations

import math
from collections.abc import Callable

from benchmarks.stopping.periodic import Periodic
from heel.schemas import Ranges, RangeSector

_RATE_HZ = 20.0
_SECTORS = 12
_FREE_M = 10.0


class RangeSensor(Periodic):
    """Publishes from a thread while `silent` is false. Use as a context manager.

    Args:
        publish: sends one message with its stamp.
        publish_spoilt: sends the same in a way that nobody can read.
    """

    def __init__(
        self, publish: Callable[[Ranges], None], publish_spoilt: Callable[[Ranges], None]
    ) -> None:
        super().__init__()
        self.silent = False
        self.spoilt = False
        self._publish_spoilt = publish_spoilt
        self._publish = publish

    def run(self) -> None:
        """As `Periodic.run`."""
        width_rad = 2.0 * math.pi / _SECTORS
        sectors = tuple(
            RangeSector(
                bearing_rad=math.remainder(number * width_rad, 2.0 * math.pi),
                width_rad=width_rad, distance_m=_FREE_M,
            )
            for number in range(_SECTORS)
        )  # fmt: skip
        for turn in self.turns(_RATE_HZ):
            if not self.silent:
                publish = self._publish_spoilt if self.spoilt else self._publish
                publish(Ranges(seq=turn + 1, sectors=sectors))
