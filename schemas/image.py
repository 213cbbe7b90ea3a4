"""Pixels to payload and back, beside the `Header` that travels as attachment."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.errors import MessageError
from heel.schemas.frame import Header

RAW = "image/raw;bgr8"
JPEG = "image/jpeg"
DEPTH = "image/raw;depth16"
MAX_IMAGE_BYTES = 8 << 20
"""Largest image payload [bytes]: 1080p raw is 6.2 MB; larger frames are scaled down by capture."""
MAX_IMAGE_PIXELS = 7680 * 4320
"""Largest image that is decoded [pixels]: 8K, 100 MB."""

_SOF_MARKERS = frozenset({0xC0, 0xC1, 0xC2})
"""Markers of a start of frame: baseline, extended sequential, progressive."""
_START_OF_SCAN = b"\xff\xda"
_MAX_SCANS = 16
"""Most scans of a JPEG: each costs work on the whole image but only 10 bytes of payload; encoders
write 1 to 10."""
# Segments that may stand before the frame: DHT, DQT, DRI, APPn, COM. All have their length in them,
# so that this reader and libjpeg cannot find different frames in one payload.
_SEGMENTS = frozenset({0xC4, 0xDB, 0xDD, 0xFE, *range(0xE0, 0xF0)})
_END_OF_IMAGE = b"\xff\xd9"
_FLAGS = cv2.IMREAD_COLOR_BGR | cv2.IMREAD_IGNORE_ORIENTATION


def encode_image(pixels: NDArray[np.uint8], encoding: str, jpeg_quality: int = 90) -> bytes:
    """Pack a (H, W, 3) uint8 BGR image as `image/raw;bgr8` or `image/jpeg`.

    Raises:
        MessageError: unknown encoding, or the payload would exceed `MAX_IMAGE_BYTES`.
    """
    if encoding == RAW:
        payload = pixels.tobytes()
    elif encoding == JPEG:
        done, packed = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality])
        if not done:
            raise MessageError(f"image {pixels.shape} cannot be coded as JPEG: use {RAW}")
        payload = packed.tobytes()
    else:
        raise MessageError(f"image encoding {encoding[:80]!r}: use {RAW} or {JPEG}")
    if len(payload) > MAX_IMAGE_BYTES:
        raise MessageError(
            f"image of {len(payload)} bytes exceeds {MAX_IMAGE_BYTES}: use --scale or {JPEG}"
        )
    return payload


def decode_image(payload: bytes, header: Header, encoding: str) -> NDArray[np.uint8]:
    """Unpack an image; (header.height, header.width, 3) uint8 BGR, read-only when raw.

    Raises:
        MessageError: encoding, size or content contradict the header.
    """
    if encoding != header.image_encoding:
        raise MessageError(
            f"image: encoding {encoding[:80]!r} but the header says {header.image_encoding!r}"
        )
    if len(payload) > MAX_IMAGE_BYTES:
        raise MessageError(f"image: {len(payload)} bytes exceed the cap of {MAX_IMAGE_BYTES}")
    if header.image_encoding == DEPTH:
        raise MessageError(f"image: depth ({DEPTH}) in place of colours: send it on its own topic")
    if header.image_encoding == RAW:
        if len(payload) != header.width * header.height * 3:
            raise MessageError(
                f"image: {len(payload)} bytes are not {header.width}x{header.height} BGR pixels"
            )
        return np.frombuffer(payload, np.uint8).reshape(header.height, header.width, 3)
    # The size is read before anything is decoded: a JPEG of some kB can unpack to 12 GB.
    return _decode_jpeg(payload, header.width, header.height)


def encode_depth(depth_mm: NDArray[np.uint16]) -> bytes:
    """Pack a (H, W) uint16 depth picture: millimetres, 0 where nothing was measured.

    Raises:
        MessageError: the payload would exceed `MAX_IMAGE_BYTES`.
    """
    payload = depth_mm.astype("<u2", copy=False).tobytes()
    if len(payload) > MAX_IMAGE_BYTES:
        raise MessageError(
            f"depth of {len(payload)} bytes exceeds {MAX_IMAGE_BYTES}: use a smaller picture"
        )
    return payload


def decode_depth(payload: bytes, header: Header, encoding: str) -> NDArray[np.uint16]:
    """Unpack a depth picture; (header.height, header.width) uint16 millimetres, read-only.

    Raises:
        MessageError: encoding or size contradict the header.
    """
    if encoding != DEPTH or header.image_encoding != DEPTH:
        raise MessageError(f"depth: encoding {encoding[:80]!r}: send it as {DEPTH}")
    if len(payload) > MAX_IMAGE_BYTES or len(payload) != header.width * header.height * 2:
        raise MessageError(
            f"depth: {len(payload)} bytes are not {header.width}x{header.height} pixels of two "
            f"bytes, at most {MAX_IMAGE_BYTES} in all"
        )
    depth = np.frombuffer(payload, "<u2").reshape(header.height, header.width)
    return depth.astype(np.uint16, copy=False)


def _decode_jpeg(payload: bytes, width: int, height: int) -> NDArray[np.uint8]:
    check_jpeg(payload, width, height)
    try:
        pixels = cv2.imdecode(np.frombuffer(payload, np.uint8), _FLAGS)
    except cv2.error:
        pixels = None
    if pixels is None or pixels.shape != (height, width, 3):
        raise MessageError(f"image: {len(payload)} bytes are not a readable JPEG")
    return np.asarray(pixels, np.uint8)


def check_jpeg(payload: bytes, width: int, height: int) -> None:
    """Refuse a JPEG before it is decoded: by its size, number of scans and end.

    Raises:
        MessageError: it is not of `width` by `height` pixels, is cut off, or takes too much work
            to decode.
    """
    if len(payload) > MAX_IMAGE_BYTES:
        raise MessageError(f"image: {len(payload)} bytes exceed the cap of {MAX_IMAGE_BYTES}")
    if width * height > MAX_IMAGE_PIXELS:
        raise MessageError(
            f"image: {width}x{height} is beyond {MAX_IMAGE_PIXELS} pixels: use --scale"
        )
    size = jpeg_size(payload)
    if size != (width, height):
        found = "no JPEG" if size is None else f"a JPEG of {size[0]}x{size[1]}"
        raise MessageError(f"image: {found}, but the header says {width}x{height}")
    # Cameras may pad with zeros; libjpeg fills a missing rest with grey and warns on stderr.
    if not payload[-256:].rstrip(b"\0").endswith(_END_OF_IMAGE):
        raise MessageError(f"image: the JPEG of {len(payload)} bytes is cut off: resend it")
    if payload.count(_START_OF_SCAN) > _MAX_SCANS:
        raise MessageError(f"image: a JPEG of more than {_MAX_SCANS} scans: write it as baseline")


def jpeg_size(payload: bytes) -> tuple[int, int] | None:
    """Width and height of a JPEG (ITU T.81, start of frame); None for anything else."""
    position = 2
    if payload[:2] != b"\xff\xd8":
        return None
    while position + 9 <= len(payload):
        marker = payload[position + 1]
        length = int.from_bytes(payload[position + 2 : position + 4], "big")
        if payload[position] != 0xFF or length < 2:
            return None
        if marker in _SOF_MARKERS:
            height = int.from_bytes(payload[position + 5 : position + 7], "big")
            width = int.from_bytes(payload[position + 7 : position + 9], "big")
            return width, height
        if marker not in _SEGMENTS:
            return None
        position += 2 + length
    return None
