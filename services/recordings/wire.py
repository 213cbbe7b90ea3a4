"""One message as it went over the bus, and the words by which a recording keeps it.

Payloads are kept as they are, one channel for each key and encoding. The attachment of a message
(its stamp, or the header of an image) is a message of its own, on a channel beside, just before the
payload and with the same number and time.
"""

from __future__ import annotations

from dataclasses import dataclass

from heel.schemas import MESSAGES, Header, Message, Stamp

PROFILE = "heel"
"""Of the file's header."""
KEY, ENCODING, ATTACHMENT_OF = "heel.key", "heel.encoding", "heel.attachment_of"
"""Metadata of a channel: key, Zenoh encoding, and of attachments the topic that they go with."""
SESSION = "heel.recording"
"""Name of the metadata record with what is known of the recording itself."""
FLUSH_PERIOD_S = 0.25
"""Longest time that a message waits before it is given to the system: what SIGKILL costs."""
BY_ENCODING = {kind.encoding(): kind for kind in MESSAGES}


@dataclass(frozen=True, slots=True)
class WireMessage:
    """One message.

    Attributes:
        key: that it was sent on.
        encoding: as its sender names it.
        payload: bytes.
        attachment: bytes, None without one.
        logged_ns: wall clock of its arrival at the recorder, which never goes back within one
            recording.
    """

    key: str
    encoding: str
    payload: bytes
    attachment: bytes | None
    logged_ns: int

    @property
    def size(self) -> int:
        """Bytes that it takes."""
        return len(self.payload) + len(self.attachment or b"")


def attachment_kind(encoding: str) -> type[Message]:
    """What goes as attachment with a payload: the header of an image, else a stamp."""
    return Header if encoding.startswith("image/") else Stamp


def message_encoding(encoding: str) -> str:
    """The payload's encoding in words of MCAP's registry; Zenoh's own where it has none."""
    return "msgpack" if encoding in BY_ENCODING else encoding.partition(";")[0]
