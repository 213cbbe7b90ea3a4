"""Pixels and their payloads: what contradicts the header is refused before it is decoded."""

from __future__ import annotations

import contextlib
import time

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from heel.schemas import Header, MessageError, decode
from heel.schemas.image import (
    DEPTH,
    JPEG,
    MAX_IMAGE_BYTES,
    MAX_IMAGE_PIXELS,
    RAW,
    decode_depth,
    decode_image,
    encode_depth,
    encode_image,
    jpeg_size,
)
from tests.support.generated import mutated
from tests.unit.schemas.examples import golden_bytes

_HEADER = decode(Header, golden_bytes("header"))
_QUICK = settings(max_examples=150, deadline=None, derandomize=True)


def header(width: int, height: int, encoding: str) -> Header:
    return Header.model_validate(
        _HEADER.model_dump() | {"width": width, "height": height, "image_encoding": encoding}
    )


def scene(height: int, width: int) -> NDArray[np.uint8]:
    rows, columns = np.mgrid[:height, :width]
    return np.stack([rows * 3, columns * 2, rows + columns], axis=2).astype(np.uint8)


def jpeg(height: int, width: int, *options: int) -> bytes:
    return bytes(cv2.imencode(".jpg", scene(height, width), list(options))[1])


def refusal(payload: bytes, described: Header) -> str:
    with pytest.raises(MessageError, match=r"^image: ") as error:
        decode_image(payload, described, described.image_encoding)
    return str(error.value)


@pytest.mark.parametrize("size", [(1, 1), (1, 640), (480, 640), (1080, 1920)], ids=str)
def test_raw_pixels_come_back_equal(size: tuple[int, int]) -> None:
    pixels = scene(*size)
    back = decode_image(encode_image(pixels, RAW), header(size[1], size[0], RAW), RAW)
    assert np.array_equal(back, pixels)
    assert not back.flags.writeable


@pytest.mark.parametrize("size", [(1, 1), (17, 33), (480, 640)], ids=str)
def test_jpeg_pixels_come_back_nearly_equal(size: tuple[int, int]) -> None:
    pixels = scene(*size)
    back = decode_image(encode_image(pixels, JPEG, 95), header(size[1], size[0], JPEG), JPEG)
    assert back.shape == pixels.shape
    assert np.abs(back.astype(int) - pixels).mean() < 8


@pytest.mark.parametrize("change", [-3, -1, 1, 3])
def test_raw_payloads_of_another_size_are_refused(change: int) -> None:
    assert "are not 4x3 BGR pixels" in refusal(bytes(36 + change), header(4, 3, RAW))


def test_encodings_that_differ_from_the_header_or_are_unknown_are_refused() -> None:
    with pytest.raises(MessageError, match="but the header says"):
        decode_image(golden_bytes("image-raw"), _HEADER, JPEG)
    with pytest.raises(MessageError, match="use image/raw"):
        encode_image(scene(2, 2), "image/png")


def test_payloads_over_the_cap_are_refused_both_ways() -> None:
    with pytest.raises(MessageError, match="exceeds"):
        encode_image(np.zeros((2048, 2048, 3), np.uint8), RAW)
    assert "exceed the cap" in refusal(bytes(MAX_IMAGE_BYTES + 1), _HEADER)


@pytest.mark.parametrize(
    "options",
    [(), (cv2.IMWRITE_JPEG_PROGRESSIVE, 1), (cv2.IMWRITE_JPEG_RST_INTERVAL, 2),
     (cv2.IMWRITE_JPEG_OPTIMIZE, 1), (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, 0x411111)],
    ids=["baseline", "progressive", "restarts", "optimized", "4:1:1"],
)  # fmt: skip
def test_every_usual_kind_of_jpeg_is_read(options: tuple[int, ...]) -> None:
    payload = jpeg(30, 50, *options)
    assert jpeg_size(payload) == (50, 30)
    assert decode_image(payload, header(50, 30, JPEG), JPEG).shape == (30, 50, 3)


def test_padding_behind_a_jpeg_is_accepted_as_cameras_send_it() -> None:
    assert decode_image(jpeg(4, 6) + bytes(64), header(6, 4, JPEG), JPEG).shape == (4, 6, 3)


def test_exif_orientation_does_not_turn_the_picture() -> None:
    """Boxes belong to the pixels as sent, and a turned 6x4 would no longer be 6x4."""
    tiff = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
    exif = b"Exif\0\0" + tiff
    payload = jpeg(4, 6)
    turned = payload[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + payload[2:]
    assert cv2.imdecode(np.frombuffer(turned, np.uint8), cv2.IMREAD_COLOR).shape == (6, 4, 3)
    assert decode_image(turned, header(6, 4, JPEG), JPEG).shape == (4, 6, 3)


def _with_size(payload: bytes, width: int, height: int) -> bytes:
    """The same JPEG claiming another size."""
    frame = payload.index(b"\xff\xc0")
    size = height.to_bytes(2, "big") + width.to_bytes(2, "big")
    return payload[: frame + 5] + size + payload[frame + 9 :]


def _hidden_frame() -> bytes:
    """A frame of 16000x16000 behind a marker without length, which naive readers skip over."""
    small = jpeg(4, 6)
    frame = small.index(b"\xff\xc0")
    length = 2 + int.from_bytes(small[frame + 2 : frame + 4], "big")
    decoy = small[frame : frame + length]
    big = _with_size(small, 16000, 16000)
    tables, rest = big[2:frame], big[frame:]
    return b"\xff\xd8\xff\xd0" + (len(tables + rest) + 2).to_bytes(2, "big") + tables + rest + decoy


_SMALL = jpeg(4, 6)
_SCAN = _SMALL[_SMALL.index(b"\xff\xda") : -2]


@pytest.mark.parametrize(
    ("payload", "size"),
    [
        (_with_size(_SMALL, 16384, 16384), (6, 4)),
        (_with_size(_SMALL, 16384, 16384), (16384, 16384)),
        (_with_size(_SMALL, 0, 0), (6, 4)),
        (_hidden_frame(), (6, 4)),
        (_SMALL[:2] + b"\xff\xe0\0\0" + _SMALL[2:], (6, 4)),
        (_SMALL[:-2] + _SCAN * 40 + b"\xff\xd9", (6, 4)),
        (_SMALL[:-2], (6, 4)),
        (_SMALL[: len(_SMALL) // 2], (6, 4)),
        (b"\xff\xd8\xff\xd9", (6, 4)),
        (b"\xff\xd8", (6, 4)),
        (b"", (6, 4)),
        (b"\x89PNG\r\n\x1a\n" + bytes(64), (6, 4)),
        (b"GIF89a" + bytes(64), (6, 4)),
    ],
    ids=["claims more than its header", "268 megapixels", "no size", "hidden frame",
         "segment without length", "forty scans", "no end", "half", "no frame", "start only",
         "empty", "PNG", "GIF"],
)  # fmt: skip
def test_jpeg_bombs_and_fragments_are_refused_quickly(
    payload: bytes, size: tuple[int, int]
) -> None:
    started_s = time.process_time()
    refusal(payload, header(*size, JPEG))
    assert time.process_time() - started_s < 1.0


def test_scans_on_end_cannot_hold_a_service_up() -> None:
    """As many scans as are let through, at the largest size that is decoded, stay below 5 s."""
    width, height = 7680, MAX_IMAGE_PIXELS // 7680
    progressive = jpeg(16, 16, cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
    frame = progressive.index(b"\xff\xc2")
    size = height.to_bytes(2, "big") + width.to_bytes(2, "big")
    big = progressive[: frame + 5] + size + progressive[frame + 9 :]
    started_s = time.process_time()
    with contextlib.suppress(MessageError):
        decode_image(big, header(width, height, JPEG), JPEG)
    assert time.process_time() - started_s < 5.0


@_QUICK
@given(st.binary(max_size=100))
def test_any_bytes_give_an_image_or_a_message_error(payload: bytes) -> None:
    for encoding in (RAW, JPEG):
        _checked(payload, header(3, 2, encoding))


@_QUICK
@given(mutated(golden_bytes("image-jpeg")))
def test_mutated_jpegs_give_an_image_of_the_headers_size_or_a_message_error(
    payload: bytes,
) -> None:
    _checked(payload, header(3, 2, JPEG))


def _checked(payload: bytes, described: Header) -> None:
    try:
        pixels = decode_image(payload, described, described.image_encoding)
    except MessageError:
        return
    assert pixels.shape == (described.height, described.width, 3)
    assert pixels.dtype == np.uint8


def test_depth_comes_back_equal_low_byte_first() -> None:
    depth = np.arange(12, dtype=np.uint16).reshape(3, 4) * 5000
    payload = encode_depth(depth)
    assert payload[2:4] == (5000).to_bytes(2, "little")
    back = decode_depth(payload, header(4, 3, DEPTH), DEPTH)
    assert back.dtype == np.uint16
    assert np.array_equal(back, depth)


@pytest.mark.parametrize(
    ("payload", "size", "told", "said"),
    [
        (b"1" * 24, (4, 3), RAW, DEPTH), (b"1" * 24, (4, 3), DEPTH, RAW),
        (b"1" * 23, (4, 3), DEPTH, DEPTH), (b"1" * 26, (4, 3), DEPTH, DEPTH),
        (b"", (4, 3), DEPTH, DEPTH), (b"1" * 48, (4, 3), DEPTH, DEPTH),
    ],
)  # fmt: skip
def test_depth_that_contradicts_its_header_is_refused(
    payload: bytes, size: tuple[int, int], told: str, said: str
) -> None:
    with pytest.raises(MessageError, match=r"^depth: .*(pixels|send it as)"):
        decode_depth(payload, header(*size, told), said)


def test_depth_is_no_picture() -> None:
    assert "on its own topic" in refusal(b"1" * 24, header(4, 3, DEPTH))


def test_depth_beyond_the_cap_is_not_sent() -> None:
    with pytest.raises(MessageError, match="smaller picture"):
        encode_depth(np.zeros((4096, 1025), np.uint16))
