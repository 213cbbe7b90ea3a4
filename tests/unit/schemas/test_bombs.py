"""Small bytes that would unpack to much: refused in bounded time and memory."""

from __future__ import annotations

import subprocess
import sys
import textwrap
import time
import zlib
from collections.abc import Callable

import msgpack
import pytest

from heel.schemas import Blobs, Evidence, Health, Message, MessageError, Stamp, Tracks, decode
from heel.schemas.tracks import MAX_TRACKS
from tests.unit.schemas.examples import golden_bytes

_MAX_S = 1.0
"""Refusals take milliseconds; the rest is for a noisy machine."""


def _in_field(kind: type[Message], field: str, value: bytes) -> bytes:
    """Golden bytes with one more field of already packed content, which overrides the first."""
    golden = golden_bytes(kind.schema_name)
    fields = msgpack.unpackb(golden)
    body = msgpack.packb(fields | {field: None})
    head, tail = body.split(msgpack.packb(field), 1)
    assert tail.startswith(b"\xc0")
    return head + msgpack.packb(field) + value + tail[1:]


def _room(kind: type[Message]) -> int:
    return kind.max_bytes - 4096


_EMPTY_MAPS = b"\xdd" + _room(Blobs).to_bytes(4, "big") + b"\x80" * _room(Blobs)
_BAD_TRACK = msgpack.packb({f"x{i}": None for i in range(20)})

_BOMBS: dict[str, tuple[type[Message], bytes]] = {
    "array32 header of 4 G": (Blobs, _in_field(Blobs, "blobs", b"\xdd\xff\xff\xff\xff")),
    "map32 header of 4 G": (Health, _in_field(Health, "details", b"\xdf\xff\xff\xff\xff")),
    "bin32 header of 4 GB": (Blobs, _in_field(Blobs, "evidence", b"\xc6\xff\xff\xff\xff")),
    "str32 header of 4 GB": (Blobs, _in_field(Blobs, "detector", b"\xdb\xff\xff\xff\xff")),
    "top-level array32 header": (Blobs, b"\xdd\xff\xff\xff\xff"),
    "top-level map32 header": (Blobs, b"\xdf\xff\xff\xff\xff"),
    "a million empty maps as blobs": (Blobs, _in_field(Blobs, "blobs", _EMPTY_MAPS)),
    "empty maps in lists of the length that is unpacked": (
        Blobs,
        _in_field(Blobs, "blobs", b"\xdc\x03\xf0" + (b"\xdc\x03\xf0" + b"\x80" * 1008) * 1008),
    ),
    "full list of wrong tracks": (
        Tracks,
        _in_field(Tracks, "tracks", b"\xdc\x00\x80" + _BAD_TRACK * MAX_TRACKS),
    ),
    "nested lists": (Blobs, b"\x91" * _room(Blobs)),
    "nested maps": (Blobs, b"\x81\xa1v" * (_room(Blobs) // 3)),
    "nest as deep as msgpack goes, as the version": (
        Health,
        _in_field(Health, "v", b"\x91" * 1020 + b"\x01"),
    ),
    "nest as deep as msgpack goes, in a field": (
        Health,
        _in_field(Health, "details", b"\x91" * 1020 + b"\x01"),
    ),
    "extension type of 1 MB": (
        Blobs,
        _in_field(Blobs, "blobs", msgpack.packb(msgpack.ExtType(5, bytes(_room(Blobs) - 4096)))),
    ),
    "timestamp of the year 10^11": (
        Stamp,
        _in_field(Stamp, "t_sent_ns", msgpack.packb(msgpack.Timestamp(2**62, 5))),
    ),
    "timestamp extension of a wrong length": (
        Stamp,
        _in_field(Stamp, "t_sent_ns", b"\xc7\x05\xff\0\0\0\0\0"),
    ),
    "largest unsigned integer": (
        Stamp,
        _in_field(Stamp, "t_sent_ns", b"\xcf" + b"\xff" * 8),
    ),
    "string that is not UTF-8": (Stamp, _in_field(Stamp, "producer", b"\xa2\xff\xfe")),
    "integer keys": (Stamp, b"\x82\x01\x02\xa1v\x01"),
    "nil key": (Stamp, b"\x82\xc0\x02\xa1v\x01"),
    "list as key": (Stamp, b"\x81\x91\x01\x02"),
    "map as key": (Stamp, b"\x81\x81\x01\x01\x02"),
}


@pytest.mark.parametrize("name", _BOMBS)
def test_msgpack_bombs_are_refused_quickly(name: str) -> None:
    kind, payload = _BOMBS[name]
    assert len(payload) <= kind.max_bytes
    assert _refusal_s(lambda: decode(kind, payload)) < _MAX_S


def _refusal_s(decoding: Callable[[], object]) -> float:
    started_s = time.process_time()
    with pytest.raises(MessageError):
        decoding()
    return time.process_time() - started_s


def test_duplicate_keys_give_one_valid_message_of_the_last_value() -> None:
    """msgpack allows them; what counts is that a checked value cannot be replaced later."""
    golden = golden_bytes("progress")
    twice = bytes([golden[0] + 1]) + golden[1:] + msgpack.packb("seq") + b"\x05"
    assert decode(_kind("progress"), twice).model_dump()["seq"] == 5
    bad = bytes([golden[0] + 1]) + golden[1:] + msgpack.packb("seq") + b"\xff"
    with pytest.raises(MessageError, match="seq"):
        decode(_kind("progress"), bad)


def _kind(name: str) -> type[Message]:
    from heel.schemas import MESSAGES

    return next(kind for kind in MESSAGES if kind.schema_name == name)


@pytest.mark.parametrize(
    "data",
    [
        zlib.compress(bytes(200_000_000), 9)[:262_000],
        zlib.compress(bytes(2 * 131072 + 1), 9),
        zlib.compress(bytes(2 * 131072 - 1), 9),
        zlib.compress(bytes(2 * 131072), 9)[:-1],
        zlib.compress(bytes(2 * 131072), 9)[:-4] + b"\0\0\0\0",
        b"",
        b"\x78\x9c",
    ],
    ids=["200 MB", "one byte more", "one byte less", "cut off", "wrong checksum", "empty",
         "header only"],
)  # fmt: skip
def test_zlib_bombs_in_evidence_are_refused_quickly(data: bytes) -> None:
    evidence = Evidence(width=1024, height=1024, data=data)
    assert _refusal_s(evidence.array) < _MAX_S


def test_incompressible_evidence_of_the_largest_size_fits() -> None:
    import numpy as np

    noise = np.random.default_rng(0).integers(1, 3, (1024, 1024), dtype=np.uint8)
    assert (Evidence.from_array(noise).array() == noise).all()


def test_all_bombs_together_stay_below_150_mb() -> None:
    """Peak memory is measured in a process of its own, beyond what the imports take."""
    program = textwrap.dedent("""
        import resource, sys
        from tests.unit.schemas import test_bombs as bombs
        from heel.schemas import MessageError, decode
        def peak_mb(): return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        before = peak_mb()
        for kind, payload in bombs._BOMBS.values():
            try:
                decode(kind, payload)
            except MessageError:
                pass
        print(peak_mb() - before)
    """)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=30, check=True
    )
    assert float(done.stdout) < 150
