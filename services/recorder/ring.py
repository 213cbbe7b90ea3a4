"""The last seconds in memory, within a bound of time and one of bytes. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from heel.schemas import keys
from heel.services.recordings.wire import WireMessage

_MESSAGE_BYTES = 500
"""What a message takes besides its bytes, as Python keeps it."""
_LATCHED = frozenset(
    {keys.FOLLOW_STATE, keys.FOLLOW_TARGET, keys.FOLLOW_ESTOP, keys.SIM_WORLD}
)  # fmt: skip
_MOST_LATCHED = 64
"""Keys whose newest value is remembered; chosen by hand, one for each camera and four."""


class Latches:
    """The newest value of each latched topic: without them a file would begin in the middle."""

    def __init__(self) -> None:
        self._newest: dict[str, WireMessage] = {}

    def take(self, message: WireMessage) -> None:
        """Remember a message if its topic is latched."""
        key = message.key
        latched = key in _LATCHED or (key.startswith("cam/") and key.endswith("/info"))
        if latched and (key in self._newest or len(self._newest) < _MOST_LATCHED):
            self._newest[key] = message

    def values(self) -> list[WireMessage]:
        """All of them."""
        return list(self._newest.values())


class Ring:
    """Messages of the last seconds; the oldest go first.

    Args:
        longest_s: how long a message stays.
        most_bytes: of all of them together; where it is reached first, they stay less long.
    """

    def __init__(self, longest_s: float, most_bytes: int) -> None:
        self._longest_ns = round(longest_s * 1e9)
        self._most_bytes = most_bytes
        self._messages: deque[WireMessage] = deque()
        self._before = Latches()
        """What was latched before the oldest message."""
        self.bytes = 0
        self.crowded = False
        """Whether the bytes, not the time, bound it by now."""

    def add(self, message: WireMessage) -> None:
        """Take a message, and forget what is too old or too much."""
        self._messages.append(message)
        self.bytes += message.size + _MESSAGE_BYTES
        while self._messages and (
            message.logged_ns - self._messages[0].logged_ns > self._longest_ns
            or self.bytes > self._most_bytes
        ):
            self.crowded = self.bytes > self._most_bytes
            self._forget()

    def _forget(self) -> None:
        oldest = self._messages.popleft()
        self.bytes -= oldest.size + _MESSAGE_BYTES
        self._before.take(oldest)

    @property
    def seconds(self) -> float:
        """How much of the past it holds."""
        if not self._messages:
            return 0.0
        return (self._messages[-1].logged_ns - self._messages[0].logged_ns) * 1e-9

    def take_all(self) -> list[WireMessage]:
        """Everything it holds, what was latched before first; it is empty afterwards.

        So two events that follow one another make two files that do not overlap.
        """
        found = [*self._before.values(), *self._messages]
        remember(self._before, self._messages)
        self._messages, self.bytes, self.crowded = deque(), 0, False
        return found


def remember(latches: Latches, messages: Iterable[WireMessage]) -> None:
    """Take note of what is latched among some messages."""
    for message in messages:
        latches.take(message)
