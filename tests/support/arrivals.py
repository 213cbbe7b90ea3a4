"""Messages as they come off the wire, without a wire."""

from __future__ import annotations

from typing import Any, cast

from heel.schemas import FrameId, Message, Stamp, encode
from heel.services.runtime.inbox import Arrival

PRODUCER = "tracker/main@00000001"


class FakePayload:
    """The part of `zenoh.ZBytes` that an `Arrival` uses."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def __len__(self) -> int:
        return len(self._data)

    def to_bytes(self) -> bytes:
        """All of it."""
        return self._data

    def as_shm(self) -> None:
        """It never came through shared memory."""


class FakeSample:
    """The part of `zenoh.Sample` that an `Arrival` uses."""

    def __init__(self, payload: bytes, encoding: str, attachment: bytes | None) -> None:
        self.payload = FakePayload(payload)
        self.encoding = encoding
        self.attachment = None if attachment is None else FakePayload(attachment)


def arrival(
    payload: bytes, encoding: str, attachment: bytes | None, arrived_s: float = 0.0,
    topic: str = "tracks", key: str = "cam/front/tracks",
) -> Arrival:  # fmt: skip
    """An arrival of any content."""
    sample = cast(Any, FakeSample(payload, encoding, attachment))
    return Arrival(topic, key, sample, arrived_s)


def arrival_of(
    message: Message, arrived_s: float = 0.0, producer: str = PRODUCER, age_ns: int = 0
) -> Arrival:
    """An arrival of a valid message with its stamp."""
    stamp = Stamp(producer=producer, t_sent_ns=0, age_ns=age_ns)
    return arrival(encode(message), message.encoding(), encode(stamp), arrived_s)


def frame(seq: int, epoch: int = 1, stream: str = "front") -> FrameId:
    """The frame `seq`, 40 ms behind the one before."""
    return FrameId(
        stream=stream, epoch=epoch, seq=seq, index=seq, t_capture_ns=seq * 40_000_000
    )  # fmt: skip
