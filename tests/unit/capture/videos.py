"""Recordings made by the tests: every frame carries its own number as its brightness."""

from __future__ import annotations

import os
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from av.video.stream import VideoStream
from numpy.typing import NDArray

STEP = 16
"""Grey levels between two frames; more than a lossy codec changes."""


def picture(index: int, width: int = 64, height: int = 48) -> NDArray[np.uint8]:
    return np.full((height, width, 3), STEP * index + 20, np.uint8)


def index_of(image: NDArray[np.uint8]) -> int:
    return round((float(image.mean()) - 20) / STEP)


def write_video(
    path: Path, frames: int, codec: str = "mp4v", width: int = 64, height: int = 48, fps: float = 10
) -> Path:
    code = cv2.VideoWriter.fourcc(*codec)
    writer = cv2.VideoWriter(str(path), code, fps, (width, height))
    assert writer.isOpened()
    for index in range(frames):
        writer.write(picture(index, width, height))
    writer.release()
    return path


def write_noise_video(path: Path, frames: int, codec: str) -> Path:
    """Frames that do not compress, so that cutting the file in half cuts the frames in half."""
    rng = np.random.default_rng(7)
    code = cv2.VideoWriter.fourcc(*codec)
    writer = cv2.VideoWriter(str(path), code, 25.0, (64, 48))
    for _ in range(frames):
        writer.write(rng.integers(0, 255, (48, 64, 3), np.uint8))
    writer.release()
    return path


def write_picture(path: Path, image: NDArray[np.generic]) -> Path:
    assert cv2.imwrite(str(path), np.asarray(image))
    return path


def write_folder(folder: Path, numbers: list[int], pattern: str = "{:06d}.png") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for number in numbers:
        write_picture(folder / pattern.format(number), picture(number))
    return folder


def encode_video(
    path: Path,
    images: list[NDArray[np.uint8]],
    codec: str = "libx264",
    *,
    ticks: list[int] | None = None,
    options: dict[str, str] | None = None,
    matrix: tuple[int, int, int, int] | None = None,
    fps: int = 25,
) -> Path:
    """Encode pictures with PyAV.

    Args:
        path: its suffix chooses the container.
        images: (H, W, 3) uint8 BGR each.
        codec: skips the test where this FFmpeg has no such encoder.
        ticks: time stamps in frame periods; None counts.
        options: of the encoder.
        matrix: signs a, b, c, d of a display matrix.
        fps: frames per second.
    """
    if codec not in av.codecs_available:
        pytest.skip(f"FFmpeg was built without {codec}")
    height, width = images[0].shape[:2]
    with av.open(os.fspath(path), "w") as container:
        stream = container.add_stream(codec, rate=fps, options=options or {})
        assert isinstance(stream, VideoStream)
        stream.width, stream.height = width, height
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        stream.codec_context.time_base = Fraction(1, fps)
        if matrix is not None:
            a, b, c, d = (65536 * sign for sign in matrix)
            stream.set_display_matrix((a, b, 0, c, d, 0, 0, 0, 1 << 30))
        for count, image in enumerate(images):
            frame = av.VideoFrame.from_ndarray(image, "bgr24")
            frame.pts = count if ticks is None else ticks[count]
            frame.time_base = Fraction(1, fps)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path
