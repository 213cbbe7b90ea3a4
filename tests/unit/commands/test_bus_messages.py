"""Any message on the bus is told in one line, or why it cannot be."""

from __future__ import annotations

import json
import math

import msgpack
import pytest

from heel.schemas import (
    Header,
    MotionCommand,
    Ranges,
    RangeSector,
    Stamp,
    Track,
    Tracks,
    encode,
    keys,
)
from heel.services.commands.bus.message import Received, as_line, as_object, tell

PRODUCER = "tracker/main@0123abcd"
KEY = "cam/front/tracks"
TRACK = Track(
    id=7, state="tracked", box_xyxy=(1.0, 2.0, 3.5, 400.123456), velocity_pxps=(0.0, 0.0),
    area_px=5.0, span_px=2.5, identity_confidence=0.5, shown=True,
)  # fmt: skip
TRACKS = Tracks(
    stream="front", epoch=1, seq=12, index=12, t_capture_ns=5, width=640, height=480,
    source_width=640, source_height=480, tracks=(TRACK,),
)  # fmt: skip
STAMP = encode(Stamp(producer=PRODUCER, t_sent_ns=1, age_ns=30_000_000))


def came(
    payload: bytes | None, encoding: str, attachment: bytes | None = None, key: str = KEY
) -> Received:
    return Received(key, 1.0, len(payload or b""), encoding, attachment, payload)


def test_a_message_is_a_line_of_its_fields_with_sender_and_age() -> None:
    told = tell(came(encode(TRACKS), Tracks.encoding(), STAMP))
    line = as_line(KEY, told)
    assert line.startswith("cam/front/tracks tracker/main 30 ms old  seq=12 width=640")
    assert "tracks=[{id=7 " in line
    assert "400.12]" in line, "numbers are rounded for people"
    assert "epoch" not in line
    assert told.counted == (PRODUCER, 1, 12)


def test_json_holds_all_of_it() -> None:
    told = json.loads(json.dumps(as_object(KEY, tell(came(encode(TRACKS), Tracks.encoding())))))
    assert told["key"] == KEY
    assert told["kind"] == "tracks"
    assert Tracks.model_validate(told["message"]) == TRACKS


def test_json_has_no_infinity() -> None:
    sector = RangeSector(bearing_rad=0.0, width_rad=0.1, distance_m=math.inf)
    ranges = Ranges(seq=1, sectors=(sector,))
    told = as_object(keys.ROBOT_RANGE, tell(came(encode(ranges), Ranges.encoding())))
    assert json.loads(json.dumps(told, allow_nan=False))["message"] == {
        "v": 1, "seq": 1, "sectors": [{"bearing_rad": 0.0, "width_rad": 0.1, "distance_m": "inf"}],
    }  # fmt: skip


def test_of_an_image_the_header_is_told_and_its_pixels_are_not_looked_into() -> None:
    header = Header(
        stream="front", epoch=3, seq=9, index=9, t_capture_ns=5, width=2, height=1, source_width=2,
        source_height=1, image_encoding="image/raw;bgr8", producer="capture/main@0123abcd",
        age_ns=2_000_000,
    )  # fmt: skip
    told = tell(came(None, "image/raw;bgr8", encode(header)))
    assert "2 ms old  seq=9" in as_line("cam/front/image", told)
    assert told.counted == ("capture/main@0123abcd", 3, 9)
    assert "without its header" in tell(came(None, "image/jpeg")).problem


@pytest.mark.parametrize(
    ("payload", "encoding", "attachment", "words"),
    [
        (b"junk", Tracks.encoding(), None, "not msgpack"),
        (msgpack.packb({"v": 99}), Tracks.encoding(), None, "version 99 instead of 1"),
        (encode(TRACKS), Tracks.encoding(), b"\xc1", "stamp: not msgpack"),
        (b"\x00\x01", "application/octet-stream", None, "none of Heel's: 2 bytes: 00 01"),
        (b"x" * 100, "x\x1b[2J", None, "78 ..."),
        (b"{", "application/json", None, "no JSON"),
        (b"[" * 60_000, "application/json", None, "no JSON"),
        (None, "application/json", None, "0 bytes of encoding"),
        (None, Tracks.encoding(), None, "0 bytes of encoding"),
        (b"\xff", "image/jpeg", b"\xff", "header: "),
    ],
)
def test_what_cannot_be_decoded_is_said_in_one_printable_line(
    payload: bytes | None, encoding: str, attachment: bytes | None, words: str
) -> None:
    told = tell(came(payload, encoding, attachment))
    assert words in told.problem
    assert as_line("a\x1b\nb", told).isprintable()
    assert as_object(KEY, told)["problem"] == told.problem
    assert "message" not in as_object(KEY, told)


def test_json_and_text_of_others_are_shown() -> None:
    assert 'a=[1, {b="x"}]' in as_line(
        KEY, tell(came(b'{"a": [1, {"b": "x"}]}', "application/json"))
    )
    assert as_line(KEY, tell(came(b"\x1b[2Jhi\n", "text/plain"))).isprintable()
    assert "value=3" in as_line(KEY, tell(came(b"3", "application/json")))


def test_a_line_is_bounded() -> None:
    many = TRACKS.model_copy(update={"tracks": (TRACK,) * 100})
    assert len(as_line(KEY, tell(came(encode(many), Tracks.encoding())))) <= 2000


def test_what_counts_changes_is_not_counted_as_a_stream() -> None:
    command = MotionCommand(
        seq=4, linear_mps=0.0, angular_radps=0.0, ttl_s=0.5, state="idle", reason="x"
    )
    assert tell(came(encode(command), MotionCommand.encoding())).counted is None
    assert tell(came(encode(command), MotionCommand.encoding(), STAMP)).counted == (PRODUCER, 0, 4)
