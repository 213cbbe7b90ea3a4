"""Frames from a folder of pictures, in the order that their names mean."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from heel.schemas.errors import SourceError
from heel.services.capture.ffmpeg import shown_path
from heel.services.capture.frame_numbers import number_frames, ranges
from heel.services.capture.picture_file import Stretch, read_picture
from heel.services.capture.source import DEFAULT_FPS, Frame, FrameSource, Warn, log_warning
from heel.services.runtime.quiet import silence_decoders

IMAGE_SUFFIXES = frozenset(
    {".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm"}
)

VIDEO_SUFFIXES = frozenset({".mp4", ".avi", ".mkv", ".mov", ".m4v", ".webm", ".mpg", ".ts"})

_MAX_WARNINGS = 10
"""Pictures that cannot be read and are named one by one; chosen by hand."""


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
        self._missing = f"frames {ranges(missing)} missing" if missing else ""
        if missing:
            warn(f"{name}: {self._missing}; going on without them")
        self._next = 0
        self._unreadable = 0
        self._why = ""
        self._stretch = Stretch()
        self._first = self._advance()
        if self._first is None:
            raise SourceError(
                f"{name}: none of its {len(files)} pictures can be decoded; {self._why}"
            )
        if self._stretch.used is not None:
            low, high = self._stretch.used
            warn(
                f"{name}: its pictures of more than 8 bits use values from {low:.0f} to "
                f"{high:.0f} only, which are stretched"
            )
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
            try:
                image = read_picture(path, self._stretch)
            except SourceError as error:
                self._unreadable += 1
                self._why = self._why or str(error)
                self._warn_unreadable(str(error))
                continue
            height, width = image.shape[:2]
            return Frame(image, index, index / self.fps, width, height)
        return None

    def _warn_unreadable(self, why: str) -> None:
        if self._unreadable <= _MAX_WARNINGS:
            self._warn(f"{self.name}: {why}; skipped")
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
    name = shown_path(folder)
    try:
        there = [one for one in folder.iterdir() if not one.name.startswith(".") and one.is_file()]
    except OSError as error:
        raise SourceError(f"{name}: cannot be listed ({error.strerror})") from error
    files = [path for path in there if path.suffix.lower() in wanted]
    if files:
        return files
    videos = sorted(path for path in there if path.suffix.lower() in VIDEO_SUFFIXES)
    if videos:
        raise SourceError(
            f"{name}: no pictures in it, but a video: give {shown_path(videos[0])} itself"
        )
    others = sorted({path.suffix.lower() for path in there} & IMAGE_SUFFIXES)
    hint = f", there are {', '.join(others)} files" if others else ""
    raise SourceError(
        f"{name}: no pictures in it; {', '.join(sorted(wanted))} files are needed{hint}"
    )
