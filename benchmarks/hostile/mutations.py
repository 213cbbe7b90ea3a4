"""Hostile messages made from those of a running stack: drawn from a seed, nothing sent here.

None of them is for the emergency stop: what cannot be read there is a stop, and that is right.
"""

from __future__ import annotations

import copy
import random
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import msgpack

from heel.schemas import (
    Blobs,
    CameraInfo,
    DriveState,
    EndOfStream,
    FollowState,
    Header,
    Health,
    Manual,
    Message,
    MessageError,
    MotionCommand,
    Odometry,
    Pointed,
    Progress,
    Ranges,
    SimTruth,
    SimWorld,
    Stamp,
    Taken,
    Target,
    TargetRequest,
    TrackEvent,
    Tracks,
    decode,
    keys,
)
from heel.schemas.image import decode_image

CAMERA = "front"
SERVICES = ("capture", "detector", "tracker", "follower", "drive", "web")
Kind = Literal["junk", "rival", "leap"]
TOPICS: dict[str, type[Message] | None] = {
    keys.image(CAMERA): None,
    keys.jpeg(CAMERA): None,
    keys.taken(CAMERA): Taken,
    keys.info(CAMERA): CameraInfo,
    keys.blobs(CAMERA): Blobs,
    keys.tracks(CAMERA): Tracks,
    keys.events(CAMERA): TrackEvent,
    keys.progress(CAMERA, "run"): Progress,
    keys.FOLLOW_COMMAND: MotionCommand,
    keys.FOLLOW_STATE: FollowState,
    keys.FOLLOW_TARGET: Target,
    keys.FOLLOW_POINTED: Pointed,
    keys.FOLLOW_MANUAL: Manual,
    keys.ROBOT_ODOMETRY: Odometry,
    keys.ROBOT_RANGE: Ranges,
    keys.ROBOT_DRIVE: DriveState,
    keys.SIM_TRUTH: SimTruth,
    keys.SIM_WORLD: SimWorld,
    **{keys.health(service, "main"): Health for service in SERVICES},
    keys.health("nobody", "here"): Health,
}
QUERYABLES = (
    keys.info(CAMERA), keys.FOLLOW_STATE, keys.FOLLOW_TARGET, keys.FOLLOW_ESTOP, keys.SIM_WORLD,
    keys.FOLLOW_MANUAL, keys.ROUTER_VERSION, keys.ALL_CONFIG, "**",
    *(keys.config(service, "main") for service in SERVICES),
)  # fmt: skip
"""What is asked, with what nobody asks."""
STAMPED = {keys.blobs(CAMERA), keys.tracks(CAMERA), keys.FOLLOW_COMMAND}
"""Streams of a producer that the receivers stay with: under another name comes a rival's."""
_GREATEST = 2**63 - 1
_MOST_QUESTION_BYTES = 100_000
"""Of a query; beyond 64 kB a router drops it."""
_VALUES: tuple[Any, ...] = (
    None, True, False, "1", "", b"x", -1, 2**63, 2**64 - 1, -(2**63), float("nan"), float("inf"),
    float("-inf"), 1e308, -1e308, 1.5, [], {}, [[]], {"a": 1}, "x" * 5000, bytes(5000), [0] * 2000,
)  # fmt: skip
_BYTES = (
    b"\x91" * 500 + b"\xc0", b"\x91" * 100_000 + b"\xc0", b"\xdd\xff\xff\xff\xff",
    b"\xdf\xff\xff\xff\xff", b"\xc6\xff\xff\xff\xff", b"\xdb\x7f\xff\xff\xff", b"\xc1", b"\x80",
    b"\x81\xa1v\xdd\x00\x01\x86\xa0" + b"\x80" * 100_000, b"\xc7\x08\x01" + bytes(8), b"",
)  # fmt: skip
_ENCODINGS = (
    "", "zenoh/bytes", "text/plain", "application/json", "application/x-msgpack",
    "application/x-msgpack;tracks.v2", "application/x-msgpack;tracks.v1",
    "application/x-msgpack;end.v1", "image/jpeg", "image/raw;bgr8",
    "application/x-msgpack;" + "x" * 200, "\x1b[2J\n",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Wire:
    """A message as it goes over the wire."""

    key: str
    payload: bytes
    encoding: str
    attachment: bytes | None


class Mutations:
    """An endless draw of hostile messages.

    Args:
        recorded: messages of the true stack, by key; at least one.
        seed: of the draw.
    """

    def __init__(self, recorded: dict[str, list[Wire]], seed: int) -> None:
        self._recorded = recorded
        self._random = random.Random(seed)

    def draw(self, kind: Kind) -> Wire:
        """The next message of a kind.

        junk: what the receivers must refuse to read. rival: well formed, replayed or made up, under
        the name of another producer. leap: well formed, under the true producer's name, with a
        sequence number that no producer reaches.
        """
        if kind == "rival":
            return self._rival()
        if kind == "leap":
            return self._leap()
        while True:
            made = self._junk()
            if not readable(made):
                return made

    def question(self) -> Wire:
        """A query with a payload that nobody reads as a request, or with none."""
        key = self._random.choice(QUERYABLES)
        while True:
            wire = self._junk()
            try:
                decode(TargetRequest, wire.payload)
            except MessageError:
                return replace(wire, key=key, payload=wire.payload[:_MOST_QUESTION_BYTES])

    def _from(self, key: str) -> Wire:
        known = self._recorded.get(key) or self._random.choice(
            [some for some in self._recorded.values() if some]
        )
        return replace(self._random.choice(known), key=key)

    def _junk(self) -> Wire:
        chance = self._random.random()
        wire = self._from(self._random.choice(list(TOPICS)))
        if chance < 0.6:
            return replace(wire, payload=self._spoilt(wire.payload))
        if chance < 0.75:
            return replace(wire, encoding=self._random.choice(_ENCODINGS))
        attachment = self._random.choice(
            [None, b"", self._random.randbytes(30), self._spoilt(wire.attachment or b"\x80")]
        )
        if chance < 0.9:
            return replace(wire, attachment=attachment)
        return replace(wire, payload=self._spoilt(wire.payload), attachment=attachment)

    def _spoilt(self, data: bytes) -> bytes:
        draw = self._random
        chance = draw.random()
        if chance < 0.12:
            return draw.randbytes(draw.choice([0, 1, 7, 64, 1023, 4096, 70_000]))
        if chance < 0.3:
            spoilt = bytearray(data[:100_000])
            for _ in range(draw.choice([1, 1, 2, 8, 64])):
                if spoilt:
                    spoilt[draw.randrange(len(spoilt))] ^= 1 << draw.randrange(8)
            return bytes(spoilt)
        if chance < 0.4:
            return data[: draw.randrange(len(data) + 1)]
        if chance < 0.45:
            return data + draw.randbytes(draw.randrange(1, 20))
        if chance < 0.5:
            return draw.choice(_BYTES)
        return self._with_other_values(data)

    def _with_other_values(self, data: bytes) -> bytes:
        draw = self._random
        try:
            values = msgpack.unpackb(data)
        except (ValueError, msgpack.UnpackException):
            return draw.randbytes(20)
        for _ in range(draw.choice([1, 1, 1, 2, 4])):
            places = [place for place in _places(values) if place]
            if not places:
                break
            *way, last = draw.choice(places)
            inner = values
            for step in way:
                inner = inner[step]
            if draw.random() < 0.15:
                del inner[last]
            else:
                inner[last] = copy.deepcopy(draw.choice(_VALUES))
        try:
            packed: bytes = msgpack.packb(values)
        except (ValueError, OverflowError):
            return draw.randbytes(30)
        return packed

    def _rival(self) -> Wire:
        draw = self._random
        wire = self._from(draw.choice(sorted(STAMPED)))
        stamp = msgpack.unpackb(wire.attachment or b"\x80")
        service = stamp.get("producer", "x/main@0").split("/")[0]
        stamp |= {
            "producer": f"{service}/main@{draw.randrange(16**8):08x}",
            "t_sent_ns": draw.choice([0, _GREATEST, stamp.get("t_sent_ns", 0)]),
            "age_ns": draw.choice([0, 10**15]),
        }
        values = msgpack.unpackb(wire.payload)
        values["seq"] = draw.choice([0, 1, _GREATEST, values["seq"] + draw.randrange(100)])
        if "epoch" in values:
            values["epoch"] = draw.choice([values["epoch"], draw.randrange(2**62)])
        if "linear_mps" in values:
            values["linear_mps"] = draw.choice([5.0, -5.0, 1.0])
            values["angular_radps"] = draw.choice([10.0, -10.0])
        return replace(wire, payload=msgpack.packb(values), attachment=msgpack.packb(stamp))

    def _leap(self) -> Wire:
        wire = self._from(self._random.choice(sorted(STAMPED)))
        values = msgpack.unpackb(wire.payload)
        values["seq"] = self._random.choice([_GREATEST, 2**62, 2**40])
        return replace(wire, payload=msgpack.packb(values))


def readable(wire: Wire) -> bool:
    """Whether a receiver takes a message for one of its topic."""
    try:
        if wire.encoding == EndOfStream.encoding():
            decode(EndOfStream, wire.payload, wire.encoding)
            return True
        kind = TOPICS[wire.key]
        if kind is None:
            header = decode(Header, wire.attachment or b"")
            decode_image(wire.payload, header, wire.encoding)
            return True
        decode(kind, wire.payload, wire.encoding)
        if wire.key in STAMPED or wire.key in (keys.ROBOT_RANGE, keys.ROBOT_ODOMETRY):
            decode(Stamp, wire.attachment or b"")
    except MessageError:
        return False
    return True


def _places(values: Any, way: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if isinstance(values, dict):
        for key, value in values.items():
            yield from _places(value, (*way, key))
    elif isinstance(values, list):
        for index, value in enumerate(values[:4]):
            yield from _places(value, (*way, index))
    yield way
