"""Recordings made in a test, without a bus."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from heel.schemas import CameraInfo, FrameId, Header, Stamp, Tracks, encode, keys
from heel.schemas.image import DEPTH, JPEG, RAW, encode_depth, encode_image
from heel.services.recordings.wire import WireMessage
from heel.services.recordings.writing import RecordingBytes

WALL_NS = 1_790_000_000 * 10**9
PRODUCER = "capture/main@00000001"
SESSION = {"flush_period_s": "0.25"}


def image(
    seq: int, *, at_ms: int | None = None, encoding: str = RAW, epoch: int = 1,
    stream: str = "front", t_capture_ns: int | None = None,
) -> WireMessage:  # fmt: skip
    """Frame `seq` of a camera of 32x24 pixels and 25 frames a second."""
    pixels = np.random.default_rng(seq).integers(0, 256, (24, 32, 3), np.uint8)
    at_ns = WALL_NS + (40 * seq if at_ms is None else at_ms) * 1_000_000
    header = Header(
        stream=stream, epoch=epoch, seq=seq, index=seq,
        t_capture_ns=at_ns if t_capture_ns is None else t_capture_ns,
        width=32, height=24, source_width=64, source_height=48,
        image_encoding="image/raw;bgr8" if encoding == RAW else "image/jpeg", producer=PRODUCER,
    )  # fmt: skip
    key = keys.image(stream) if encoding == RAW else keys.jpeg(stream)
    return WireMessage(key, encoding, encode_image(pixels, encoding), encode(header), at_ns)


def depth(seq: int, *, at_ms: int | None = None, epoch: int = 1, cut: int = 0) -> WireMessage:
    """Depth of frame `seq`, 16x12 pixels of 1000 + `seq` mm; `cut` bytes short of that."""
    at_ns = WALL_NS + (40 * seq if at_ms is None else at_ms) * 1_000_000
    header = Header(
        stream="front", epoch=epoch, seq=seq, index=seq, t_capture_ns=at_ns, width=16, height=12,
        source_width=16, source_height=12, image_encoding=DEPTH, producer=PRODUCER,
    )  # fmt: skip
    payload = encode_depth(np.full((12, 16), 1000 + seq, np.uint16))
    return WireMessage(
        keys.depth("front"), DEPTH, payload[: len(payload) - cut], encode(header), at_ns
    )  # fmt: skip


def jpeg(seq: int) -> WireMessage:
    """The same as JPEG."""
    return image(seq, encoding=JPEG)


def info(
    frame_count: int | None = None, stream: str = "front", fov_rad: float | None = None
) -> WireMessage:  # fmt: skip
    """What that camera says of itself."""
    said = CameraInfo(
        stream=stream, epoch=1, width=32, height=24, source_width=64, source_height=48, fps=25.0,
        frame_count=frame_count, source="made", horizontal_fov_rad=fov_rad,
    )  # fmt: skip
    return WireMessage(keys.info(stream), said.encoding(), encode(said), None, WALL_NS)


def tracks(seq: int, at_ms: int | None = None) -> WireMessage:
    """Empty tracks of frame `seq`."""
    at_ns = WALL_NS + (40 * seq if at_ms is None else at_ms) * 1_000_000
    frame = FrameId(stream="front", epoch=1, seq=seq, index=seq, t_capture_ns=at_ns)
    said = Tracks(**frame.model_dump(), width=32, height=24, source_width=64, source_height=48)
    stamp = Stamp(producer="tracker/main@00000001", t_sent_ns=at_ns, age_ns=5_000_000)
    return WireMessage(keys.tracks("front"), said.encoding(), encode(said), encode(stamp), at_ns)


def recording(path: Path, messages: Iterable[WireMessage], closed: bool = True) -> Path:
    """Write a recording; one that is not closed ends as SIGKILL leaves it."""
    made = RecordingBytes(SESSION, "heel test")
    with path.open("wb") as file:
        for message in messages:
            made.add(message)
        file.writelines(made.flush())
        if closed:
            file.writelines(made.finish())
    return path
