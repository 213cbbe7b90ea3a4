"""Questions on the bus: who is asked, and what comes back."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterator

import zenoh
from zenoh.handlers import Callback

EVERYBODY = zenoh.QueryTarget.ALL
"""Target of every question. By default Zenoh asks one program that calls itself complete in place
of all others: one that answers for `**` and hangs would leave nobody to stop or resume by."""
EVERY_ANSWER = zenoh.ConsolidationMode.NONE
"""What is passed on of the answers on one key, as they come. By default Zenoh waits until all have
answered, or the time is over, and passes on the last one alone (1.10): of a drive that holds the
emergency stop and a page that tells of an older release only one would be heard."""
_MOST = 16
"""Answers taken to one question; no topic has as many holders."""
_OUT_OF_TIME = "Timeout"
"""What Zenoh puts in place of an answer when the time is over."""
_LONGEST = 300
"""Most characters of a refusal; chosen by hand."""


class Question:
    """One question, and the answers as they come.

    Neither waits for the other: a full FIFO of Zenoh's would hold up the whole link, and its ring
    loses answers when the question ends before they are read.

    Args:
        session: asks.
        key: that is asked about.
        timeout_s: after which the question is over.
    """

    def __init__(self, session: zenoh.Session, key: str, timeout_s: float) -> None:
        self._came: deque[zenoh.Reply] = deque()
        self._room = _MOST
        self._ended = threading.Event()
        session.get(
            key, Callback(self._note, self._ended.set), target=EVERYBODY,
            consolidation=EVERY_ANSWER, timeout=timeout_s,
            congestion_control=zenoh.CongestionControl.DROP,
        )  # fmt: skip

    @property
    def over(self) -> bool:
        """Whether all have answered, or the time is over, and all of it was taken."""
        return self._ended.is_set() and not self._came

    def replies(self) -> Iterator[zenoh.Reply]:
        """Those that have come since the last call, refusals too; never waits."""
        while self._came:
            yield self._came.popleft()

    def _note(self, reply: zenoh.Reply) -> None:
        if self._room:
            self._room -= 1
            self._came.append(reply)


def refusal(reply: zenoh.Reply) -> str | None:
    """Why somebody refused to answer; None for an answer, and where nobody answered in time."""
    if reply.err is None:
        return None
    words = reply.err.payload.to_bytes()[: 4 * _LONGEST].decode(errors="replace")
    words = " ".join(words.split())[:_LONGEST]
    return None if words == _OUT_OF_TIME else words
