"""One picture file to 8 bit BGR: its size is known before it is decoded, its depth is used."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import MAX_DIMENSION_PX
from heel.schemas.errors import SourceError
from heel.schemas.image import MAX_IMAGE_PIXELS, jpeg_size

_LARGEST_FILE_BYTES = 512 << 20
"""Of a picture file; larger than the largest picture without compression. Chosen by hand."""
_DEEP_FLAGS = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
_LEAST_SPREAD = 1 / 8
"""Share of the range of 16 bits below which a picture would come out flat; chosen by hand."""
_MARGIN = 0.25
"""Of the first picture's spread, left on both sides for what later ones show."""
_TIFF_ORDERS = {b"II*\0": "<", b"MM\0*": ">"}
_TIFF_TYPES = {3: "H", 4: "I"}
"""TIFF 6.0, section 2: SHORT and LONG."""


class Stretch:
    """Brings pictures of more than 8 bits to 8, all of a recording alike.

    Where a picture uses the range of its type, the upper eight bits are kept. Thermal and depth
    cameras use a small part of it, and 10 or 12 bit sensors write their values as they are: the
    part that the first such picture uses becomes the whole.

    Attributes:
        used: lowest and highest value of that part, None while the upper bits are kept.
    """

    def __init__(self) -> None:
        self.used: tuple[float, float] | None = None

    def to_8bit(self, image: NDArray[np.generic]) -> NDArray[np.uint8]:
        """Any samples as uint8, shape kept."""
        if image.dtype == np.uint8:
            return np.asarray(image, np.uint8)
        values = np.nan_to_num(image.astype(np.float32))
        if self.used is None:
            self.used = self._part_in_use(values, image.dtype == np.uint16)
        if self.used is None:
            return (values / 256.0).astype(np.uint8)
        low, high = self.used
        levels = np.clip((values - low) * (255.0 / (high - low)), 0.0, 255.0)
        return np.asarray(levels, np.uint8)

    def _part_in_use(
        self, values: NDArray[np.float32], is_16bit: bool
    ) -> tuple[float, float] | None:
        low, high = (float(edge) for edge in np.percentile(values, (0.1, 99.9)))
        spread = high - low
        if is_16bit and (spread == 0.0 or spread >= _LEAST_SPREAD * 65536.0):
            return None
        margin = max(_MARGIN * spread, 1e-6)
        return low - margin, high + margin


def read_picture(path: Path, stretch: Stretch | None = None) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 BGR of one file, whatever its depth and channels.

    Args:
        path: of the file.
        stretch: common to the pictures of a recording; None treats this one for itself.

    Raises:
        SourceError: it cannot be read, or is beyond 8K.
    """
    unreadable = SourceError(f"{path.name}: not a readable picture; copy it again")
    try:
        if path.stat().st_size > _LARGEST_FILE_BYTES:
            raise SourceError(f"{path.name}: a picture of more than 512 MiB; make it smaller")
        data = np.fromfile(path, np.uint8)
    except OSError:
        raise unreadable from None
    content = data.tobytes()
    if size := picture_size(content):
        check_size(path.name, *size)
    # libpng prints its complaint about a cut file straight to stderr; the end chunk is checked
    # instead of letting it decode.
    if not content or (content.startswith(b"\x89PNG") and b"IEND" not in content):
        raise unreadable
    try:
        image = cv2.imdecode(data, _DEEP_FLAGS)
    except cv2.error:
        image = None
    if image is None:
        raise unreadable
    check_size(path.name, image.shape[1], image.shape[0])
    return np.ascontiguousarray((stretch or Stretch()).to_8bit(image), np.uint8)


def check_size(name: str, width: int, height: int) -> None:
    """Refuse a picture that no message can describe, or that would fill the memory.

    Raises:
        SourceError: a side or the number of pixels is beyond the limit.
    """
    if max(width, height) > MAX_DIMENSION_PX or width * height > MAX_IMAGE_PIXELS:
        raise SourceError(
            f"{name}: {width}x{height} pixels; at most {MAX_IMAGE_PIXELS} (8K) and "
            f"{MAX_DIMENSION_PX} a side are read: make it smaller"
        )


def picture_size(data: bytes) -> tuple[int, int] | None:
    """Width and height that a picture's header states; None where it is of no known format.

    PNG (ISO 15948), JPEG (ITU T.81), BMP, PNM, WebP (RFC 9649) and TIFF 6.0 are known.
    """
    try:
        if data.startswith(b"\x89PNG\r\n\x1a\n"):
            width, height = struct.unpack(">II", data[16:24])
        elif data.startswith(b"BM"):
            width, height = struct.unpack("<ii", data[18:26])
        elif data.startswith(b"RIFF") and data[8:12] == b"WEBP":
            return _webp_size(data)
        elif data[:4] in _TIFF_ORDERS:
            return _tiff_size(data, _TIFF_ORDERS[data[:4]])
        elif re.match(rb"P[1-6]\s", data):
            found = re.match(rb"P[1-6](?:\s+|#[^\n]*\n)+(\d+)(?:\s+|#[^\n]*\n)+(\d+)", data[:1024])
            return None if found is None else (int(found.group(1)), int(found.group(2)))
        else:
            return jpeg_size(data)
    except struct.error:
        return None
    return abs(width), abs(height)


def _webp_size(data: bytes) -> tuple[int, int] | None:
    kind = data[12:16]
    if kind == b"VP8X":
        return (
            int.from_bytes(data[24:27], "little") + 1,
            int.from_bytes(data[27:30], "little") + 1,
        )
    if kind == b"VP8L":
        bits = int.from_bytes(data[21:25], "little")
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b"VP8 ":
        width, height = struct.unpack("<HH", data[26:30])
        return width & 0x3FFF, height & 0x3FFF
    return None


def _tiff_size(data: bytes, order: str) -> tuple[int, int] | None:
    (offset,) = struct.unpack_from(f"{order}I", data, 4)
    (count,) = struct.unpack_from(f"{order}H", data, offset)
    sides: dict[int, int] = {}
    for entry in range(count):
        place = offset + 2 + 12 * entry
        tag, kind = struct.unpack_from(f"{order}HH", data, place)
        if tag in (256, 257) and kind in _TIFF_TYPES:
            (sides[tag],) = struct.unpack_from(order + _TIFF_TYPES[kind], data, place + 8)
    return (sides[256], sides[257]) if len(sides) == 2 else None
