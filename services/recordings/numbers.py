"""What is missing of a topic, by the numbers that its senders give their messages. Pure."""

from __future__ import annotations

from heel.schemas import (
    DriveState,
    Header,
    MessageError,
    MotionCommand,
    Odometry,
    Ranges,
    Stamp,
    decode,
)
from heel.services.recordings.wire import WireMessage

Number = tuple[str, int, int]
"""(sender, its epoch, number within that)."""
_MOST_SENDERS = 256
"""Senders of one topic that are told apart; bounds the memory."""
_OWN_NUMBERS: dict[str, type[MotionCommand | Odometry | Ranges | DriveState]] = {
    kind.encoding(): kind for kind in (MotionCommand, Odometry, Ranges, DriveState)
}


class Gaps:
    """Counts the messages of one topic that are missing between those that came."""

    def __init__(self) -> None:
        self.missing = 0
        self._newest: dict[tuple[str, int], int] = {}

    def take(self, number: Number) -> None:
        """The next message's number; one from before the newest fills no gap."""
        sender, epoch, seq = number
        newest = self._newest.get((sender, epoch))
        if newest is not None:
            self.missing += max(0, seq - newest - 1)
        if newest is not None or len(self._newest) < _MOST_SENDERS:
            self._newest[sender, epoch] = max(seq, newest or 0)


def own_number(message: WireMessage) -> Number | None:
    """The number of a message that its sender counts without gaps; None of all others.

    Pictures, commands, and what wheels and sensors say. Blobs and tracks have the numbers of
    their pictures, of which a busy detector leaves some out.
    """
    attachment = message.attachment
    try:
        if message.encoding.startswith("image/"):
            header = decode(Header, attachment or b"")
            return header.producer, header.epoch, header.seq
        if (kind := _OWN_NUMBERS.get(message.encoding)) is not None:
            sender = message.key if attachment is None else decode(Stamp, attachment).producer
            return sender, 0, decode(kind, message.payload, message.encoding).seq
    except MessageError:
        # Who works with it says so.
        return None
    return None
