"""Frames of a video file, through FFmpeg."""

from __future__ import annotations

import os
from pathlib import Path

import cv2

from schemas.errors import SourceError
from services.capture.pixels import to_bgr8
from services.capture.quiet import silence_decoders
from services.capture.source import Frame, FrameSource, Warn, log_warning, plausible_fps


class VideoFileSource(FrameSource):
    """A video file, frame after frame at its nominal rate.

    What can be decoded before a damage is delivered; `end_reason` then says how much is missing.
    Where the resolution changes in mid-stream, OpenCV 5.0 scales to the size of the first frame.

    Raises:
        SourceError: the file is missing, empty or holds no video that FFmpeg can decode.
    """

    def __init__(self, path: Path, warn: Warn = log_warning) -> None:
        self.name = str(path)
        self._warn = warn
        self._capture = _open(path)
        self._index = 0
        # The first frame is decoded here: a file may have a good header and nothing behind it, and
        # the header's size is that of the container, which rotation swaps.
        self._first = self._decode()
        if self._first is None:
            self._capture.release()
            raise SourceError(
                f"{path}: no frame can be decoded; the file is damaged or truncated, copy it again"
            )
        self.width, self.height = self._first.source_width, self._first.source_height
        announced = self._capture.get(cv2.CAP_PROP_FRAME_COUNT)
        self.frame_count = int(announced) if 0 < announced < 2**31 else None

    def read(self, timeout_s: float = 5.0) -> Frame | None:
        """The next frame, None at the end; a file never times out."""
        frame, self._first = self._first, None
        if frame is None:
            frame = self._decode()
        if frame is None and not self.end_reason:
            self.end_reason = self._judge_end()
        return frame

    def close(self) -> None:
        """Close the file."""
        self._first = None
        self._capture.release()

    def _decode(self) -> Frame | None:
        if not self._capture.isOpened():
            return None
        if self._index == 0:
            self.fps = plausible_fps(
                float(self._capture.get(cv2.CAP_PROP_FPS)), self.name, self._warn
            )
        done, picture = self._capture.read()
        if not done:
            return None
        image = to_bgr8(picture)
        height, width = image.shape[:2]
        frame = Frame(image, self._index, self._index / self.fps, width, height)
        self._index += 1
        return frame

    def _judge_end(self) -> str:
        if not self._capture.isOpened():
            return "closed"
        # One frame of slack: containers without an index state duration times rate, rounded.
        if self.frame_count is None or self._index >= self.frame_count - 1:
            return "end of file"
        reason = (
            f"{self.name}: ended after {self._index} of {self.frame_count} frames; the file is "
            "damaged or truncated, copy or convert it again"
        )
        self._warn(reason)
        return reason


def _open(path: Path) -> cv2.VideoCapture:
    silence_decoders()
    if not path.exists():
        raise SourceError(f"{path}: no such file or folder; check the path")
    if not path.is_file():
        raise SourceError(f"{path}: not a regular file; give a video file or a folder of images")
    if not os.access(path, os.R_OK):
        raise SourceError(f"{path}: may not be read; check its permissions")
    if path.stat().st_size == 0:
        raise SourceError(f"{path}: the file is empty; copy it again")
    # An absolute path, since FFmpeg takes `a:b.mp4` for a protocol named `a`.
    capture = cv2.VideoCapture(os.path.abspath(path), cv2.CAP_FFMPEG)
    if not capture.isOpened():
        capture.release()
        raise SourceError(
            f"{path}: not a video that FFmpeg can read, or cut off before its index; "
            "check the file or convert it"
        )
    return capture
