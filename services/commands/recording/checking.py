"""What is in a recording and what is missing from it. Pure but for reading the file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from heel.services.commands.bus.message import Received, tell
from heel.services.recordings.numbers import Gaps
from heel.services.recordings.reading import Recording, wire_messages
from heel.services.recordings.wire import WireMessage


@dataclass
class TopicCheck:
    """One topic of a recording.

    Attributes:
        messages: that are there.
        bytes: of their payloads.
        missing: messages that are not there by their senders' numbers; of blobs and tracks, which
            have the numbers of pictures, those of pictures that were left out, too.
        undecodable: payloads that are not what their encoding says.
        first_ns, last_ns: when the first and the last was recorded.
    """

    messages: int = 0
    bytes: int = 0
    undecodable: int = 0
    first_ns: int = 0
    last_ns: int = 0
    _gaps: Gaps = field(default_factory=Gaps)

    @property
    def missing(self) -> int:
        """See above."""
        return self._gaps.missing

    def take(self, message: WireMessage) -> None:
        """Count one message."""
        self.first_ns = self.first_ns or message.logged_ns
        self.last_ns = message.logged_ns
        self.messages += 1
        self.bytes += len(message.payload)
        received = Received(
            message.key, 0.0, len(message.payload), message.encoding, message.attachment,
            message.payload,
        )  # fmt: skip
        told = tell(received)
        if told.problem:
            self.undecodable += 1
        if told.counted is not None:
            self._gaps.take(told.counted)

    @property
    def seconds(self) -> float:
        """From the first to the last."""
        return (self.last_ns - self.first_ns) * 1e-9


@dataclass
class Check:
    """A recording that was read to its end.

    Attributes:
        recording: what it says of itself.
        topics: by key.
        first_ns, last_ns: when the first and the last message was recorded.
        cut_bytes: at the end of the file, of a record that is not whole.
    """

    recording: Recording
    topics: dict[str, TopicCheck] = field(default_factory=dict)
    first_ns: int = 0
    last_ns: int = 0
    cut_bytes: int = 0

    @property
    def seconds(self) -> float:
        """From the first message to the last."""
        return (self.last_ns - self.first_ns) * 1e-9

    @property
    def lost_at_end_s(self) -> float | None:
        """Most that is missing at the end; None where the file does not tell."""
        if self.recording.complete:
            return 0.0
        try:
            return float(self.recording.session["flush_period_s"])
        except (KeyError, ValueError):
            return None

    def as_object(self) -> dict[str, Any]:
        """All of it, for `--json`."""
        return {
            "file": str(self.recording.path), "complete": self.recording.complete,
            "damage": self.recording.damage, "cut_bytes": self.cut_bytes,
            "lost_at_end_s": self.lost_at_end_s, "seconds": round(self.seconds, 3),
            "first_ns": self.first_ns, "last_ns": self.last_ns,
            "recording": self.recording.session,
            "topics": {
                key: {"messages": one.messages, "bytes": one.bytes, "missing": one.missing,
                      "undecodable": one.undecodable, "first_ns": one.first_ns,
                      "last_ns": one.last_ns}
                for key, one in sorted(self.topics.items())
            },
        }  # fmt: skip


def check(recording: Recording) -> Check:
    """Read a recording to its end.

    Raises:
        SourceError: it cannot be read, or is none.
    """
    found = Check(recording)
    for message in wire_messages(recording):
        found.first_ns = min(found.first_ns or message.logged_ns, message.logged_ns)
        found.last_ns = max(found.last_ns, message.logged_ns)
        found.topics.setdefault(message.key, TopicCheck()).take(message)
    if not recording.complete:
        found.cut_bytes = max(0, recording.path.stat().st_size - recording.whole_bytes)
    return found
