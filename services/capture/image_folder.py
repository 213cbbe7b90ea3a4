"""Frames from a folder of pictures, in the order of the numbers in their names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from schemas.errors import SourceError
from services.capture.quiet import silence_decoders
from services.capture.source import DEFAULT_FPS, Frame, FrameSource, Warn, log_warning

IMAGE_SUFFIXES = frozenset(
    {".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm"}
)

_MAX_WARNINGS = 10
_MAX_SPREAD = 10
"""Numbers that spread wider than this times their count are time stamps, not frame numbers."""


class ImageFolderSource(FrameSource):
    """Pictures of one folder as a recording.

    A picture that cannot be decoded is left out and named in a warning, and so are numbers missing
    from the sequence: `Frame.index` follows the numbers, so that ground truth stays aligned.

    Args:
        files: the pictures, in any order; not empty.
        name: for people.
        fps: frames per second.
        first_number: number of the frame with index 0; None takes the lowest there is.
        expected_count: frames there should be; None takes what there is.
        warn: told of every defect.

    Raises:
        SourceError: no picture can be decoded.
    """

    def __init__(
        self,
        files: Sequence[Path],
        name: str,
        fps: float = DEFAULT_FPS,
        first_number: int | None = None,
        expected_count: int | None = None,
        warn: Warn = log_warning,
    ) -> None:
        silence_decoders()
        self.name, self.fps, self._warn = name, fps, warn
        self._files, missing = number_frames(files, first_number, expected_count)
        self.frame_count = len(self._files)
        self._missing = f"frames {_ranges(missing)} missing" if missing else ""
        if missing:
            warn(f"{name}: {self._missing}; going on without them")
        self._next = 0
        self._unreadable = 0
        self._first = self._advance()
        if self._first is None:
            raise SourceError(f"{name}: none of its {len(files)} pictures can be decoded")
        self.width, self.height = self._first.source_width, self._first.source_height

    def read(self, timeout_s: float = 5.0) -> Frame | None:
        """The next picture, None after the last; a folder never times out."""
        frame, self._first = self._first, None
        if frame is None:
            frame = self._advance()
        if frame is None:
            unreadable = f"{self._unreadable} unreadable" if self._unreadable else ""
            defects = ", ".join(filter(None, (self._missing, unreadable)))
            self.end_reason = f"end of folder; {defects}" if defects else "end of folder"
        return frame

    def close(self) -> None:
        """Stop delivering; no file is held open between reads."""
        self._first = None
        self._next = len(self._files)

    def _advance(self) -> Frame | None:
        while self._next < len(self._files):
            index, path = self._files[self._next]
            self._next += 1
            image = decode_picture(path)
            if image is None:
                self._unreadable += 1
                self._warn_unreadable(path)
                continue
            height, width = image.shape[:2]
            return Frame(image, index, index / self.fps, width, height)
        return None

    def _warn_unreadable(self, path: Path) -> None:
        if self._unreadable <= _MAX_WARNINGS:
            self._warn(f"{path}: not a readable picture; skipped, copy it again")
        if self._unreadable == _MAX_WARNINGS:
            self._warn(f"{self.name}: further unreadable pictures are only counted")


def list_images(folder: Path, suffix: str | None = None) -> list[Path]:
    """Pictures in a folder, unsorted; hidden files are left out.

    Args:
        folder: an existing directory.
        suffix: take files of this suffix only (`.jpg`), else every known one.

    Raises:
        SourceError: there is none, or the folder may not be read.
    """
    wanted = IMAGE_SUFFIXES if suffix is None else {suffix.lower()}
    try:
        files = [
            path
            for path in folder.iterdir()
            if path.suffix.lower() in wanted and not path.name.startswith(".") and path.is_file()
        ]
    except OSError as error:
        raise SourceError(f"{folder}: cannot be listed ({error.strerror})") from error
    if not files:
        raise SourceError(
            f"{folder}: no pictures in it; {', '.join(sorted(wanted))} files are needed"
        )
    return files


def number_frames(
    files: Iterable[Path], first_number: int | None = None, expected_count: int | None = None
) -> tuple[list[tuple[int, Path]], list[int]]:
    """Pair each picture with its index, and list the numbers that are missing.

    The last run of digits in a name is its number. Names without numbers, with equal numbers, or
    with time stamps for numbers are taken in natural order and numbered as they come.
    """
    ordered = sorted(files, key=_natural_key)
    numbers = [_number(path) for path in ordered]
    present = sorted(number for number in numbers if number is not None)
    unique = len(set(present)) == len(ordered)
    if not unique or present[-1] - present[0] >= _MAX_SPREAD * max(10, len(ordered)):
        return list(enumerate(ordered)), []
    first = present[0]
    if first_number is not None:
        first = min(first, first_number)
    last = present[-1]
    if expected_count is not None:
        last = max(last, min(first + expected_count - 1, present[-1] + _MAX_SPREAD * len(ordered)))
    missing = sorted(set(range(first, last + 1)) - set(present))
    by_number = sorted(zip((n for n in numbers if n is not None), ordered, strict=True))
    return [(number - first, path) for number, path in by_number], missing


def decode_picture(path: Path) -> NDArray[np.uint8] | None:
    """(H, W, 3) uint8 BGR of one file, whatever its depth and channels; None if unreadable."""
    try:
        data = np.fromfile(path, np.uint8)
    except OSError:
        return None
    # libpng prints its complaint about a cut file straight to stderr; the end chunk is checked
    # instead of letting it decode.
    is_png = data[:4].tobytes() == b"\x89PNG"
    if data.size == 0 or (is_png and b"IEND" not in data.tobytes()):
        return None
    try:
        image = cv2.imdecode(data, cv2.IMREAD_COLOR)
    except cv2.error:
        return None
    return None if image is None else np.ascontiguousarray(image, np.uint8)


def _number(path: Path) -> int | None:
    digits = re.findall(r"\d+", path.stem)
    return int(digits[-1]) if digits else None


def _natural_key(path: Path) -> list[tuple[int, str]]:
    """Digits compared as numbers: img2 before img10."""
    parts = re.split(r"(\d+)", path.name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]


def _ranges(numbers: Sequence[int], limit: int = 5) -> str:
    """`3, 7-9` of [3, 7, 8, 9]; the first `limit` runs only."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    texts = [f"{a}" if a == b else f"{a}-{b}" for a, b in runs[:limit]]
    more = f" and more ({len(numbers)} in all)" if len(runs) > limit else ""
    return ", ".join(texts) + more
