"""Recordings made by the tests: every frame carries its own number as its brightness."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
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
