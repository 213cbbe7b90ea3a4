"""Back-pressure of a lossless run: no frame goes out before the slowest consumer has room."""

from __future__ import annotations

from collections.abc import Iterable

from heel.schemas import Progress


class CreditWindow:
    """How many frames may be in flight, judged by what every named consumer has finished."""

    def __init__(self, consumers: Iterable[str], epoch: int, window_frames: int) -> None:
        self._window = window_frames
        self._epoch = epoch
        self._done = dict.fromkeys(consumers, -1)

    def update(self, consumer: str, progress: Progress) -> None:
        """Note what a consumer has finished; strangers and other epochs are ignored."""
        if consumer in self._done and progress.epoch == self._epoch:
            self._done[consumer] = max(self._done[consumer], progress.seq)

    def may_send(self, seq: int) -> bool:
        """Whether frame `seq` fits into the window of every consumer."""
        return all(seq - done <= self._window for done in self._done.values())

    def slowest(self) -> str:
        """The part that holds the stream up."""
        return min(self._done, key=lambda name: self._done[name], default="nobody")
