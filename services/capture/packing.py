"""From a frame to what goes on the wire: header, payload, and the size cap kept."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schemas import Header
from schemas.image import JPEG, MAX_IMAGE_BYTES, RAW, encode_image
from services.capture.pixels import shrink
from services.capture.source import Frame


@dataclass(frozen=True)
class StreamIdentity:
    """What every header of one capture start has in common."""

    stream: str
    epoch: int
    producer: str


def fit_to_cap(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The image itself, or shrunk so that its raw pixels fit into one message.

    8K raw is 100 MB; the cap is 8 MiB (1080p is 6.2 MB).
    """
    if image.nbytes <= MAX_IMAGE_BYTES:
        return image
    return shrink(image, math.sqrt(MAX_IMAGE_BYTES / image.nbytes) * 0.999)


def pack_frame(
    identity: StreamIdentity,
    frame: Frame,
    seq: int,
    t_capture_ns: int,
    age_ns: int,
    image_encoding: str,
    jpeg_quality: int,
) -> tuple[Header, bytes]:
    """Header and payload of one frame whose image fits the cap already."""
    height, width = frame.image.shape[:2]
    header = Header(
        stream=identity.stream,
        epoch=identity.epoch,
        seq=seq,
        index=frame.index,
        t_capture_ns=t_capture_ns,
        width=width,
        height=height,
        source_width=frame.source_width,
        source_height=frame.source_height,
        image_encoding=RAW if image_encoding == "raw" else JPEG,
        producer=identity.producer,
        age_ns=age_ns,
    )
    return header, encode_image(frame.image, header.image_encoding, jpeg_quality)
