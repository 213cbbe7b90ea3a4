"""From pixels to what goes on the wire: header and payload."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Header
from heel.schemas.image import JPEG, RAW, encode_image


@dataclass(frozen=True)
class StreamIdentity:
    """What every header of one start of a stream has in common."""

    stream: str
    epoch: int
    producer: str


@dataclass(frozen=True)
class ImageCoding:
    """How pixels travel: raw on one host, JPEG of a quality in percent across a network."""

    encoding: Literal["raw", "jpeg"] = "raw"
    jpeg_quality: int = 90


def pack_image(
    identity: StreamIdentity,
    image: NDArray[np.uint8],
    numbers: tuple[int, int],
    source_size: tuple[int, int],
    t_capture_ns: int,
    age_ns: int,
    coding: ImageCoding,
) -> tuple[Header, bytes]:
    """Header and payload of one frame.

    Args:
        identity: of the stream.
        image: (H, W, 3) uint8 BGR that fits the cap already.
        numbers: seq within the stream, and index on the source's own timeline.
        source_size: width and height before anything scaled it, pixels.
        t_capture_ns: acquisition time.
        age_ns: monotonic time since then.
        coding: how the pixels travel.
    """
    height, width = image.shape[:2]
    seq, index = numbers
    header = Header(
        stream=identity.stream,
        epoch=identity.epoch,
        seq=seq,
        index=index,
        t_capture_ns=t_capture_ns,
        width=width,
        height=height,
        source_width=source_size[0],
        source_height=source_size[1],
        image_encoding=RAW if coding.encoding == "raw" else JPEG,
        producer=identity.producer,
        age_ns=age_ns,
    )
    return header, encode_image(image, header.image_encoding, coding.jpeg_quality)
