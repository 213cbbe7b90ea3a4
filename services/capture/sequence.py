"""MOTChallenge sequence directories: `seqinfo.ini` beside the pictures or the video it names."""

from __future__ import annotations

import configparser
import re
from pathlib import Path

from schemas.errors import SourceError
from services.capture.image_folder import ImageFolderSource, list_images
from services.capture.source import FrameSource, Warn, log_warning, plausible_fps
from services.capture.video_file import VideoFileSource

SEQUENCE_FILE = "seqinfo.ini"
VIDEO_SUFFIXES = frozenset({".mp4", ".avi", ".mkv", ".mov", ".m4v", ".webm", ".mpg", ".ts"})


def open_sequence(folder: Path, warn: Warn = log_warning) -> FrameSource:
    """Open a MOTChallenge sequence (https://motchallenge.net/instructions/).

    `imDir` names the folder of pictures (default `img1`), `imExt` their suffix. A video suffix
    (`.mp4`, `.avi`, ...) means one video file of that suffix in `imDir`, whose n-th frame is
    frame n.

    Raises:
        SourceError: `seqinfo.ini` cannot be parsed, or what it names is not there.
    """
    section = _read_section(folder / SEQUENCE_FILE)
    pictures = folder / section.get("imDir", "img1")
    suffix = section.get("imExt", ".jpg").lower()
    fps = plausible_fps(_number(section, "frameRate", folder), str(folder), warn)
    length = int(_number(section, "seqLength", folder)) or None
    if not pictures.is_dir():
        raise SourceError(
            f"{folder}: {SEQUENCE_FILE} names imDir={pictures.name}, which is not there; "
            "this copy has no pictures"
        )
    videos = sorted(pictures.glob(f"*{suffix}")) if suffix in VIDEO_SUFFIXES else []
    if suffix in VIDEO_SUFFIXES:
        if len(videos) != 1:
            raise SourceError(
                f"{pictures}: {len(videos)} {suffix} files where {SEQUENCE_FILE} means one; "
                "keep one or give the file itself"
            )
        return _open_video(videos[0], fps, length, warn)
    files = list_images(pictures, suffix)
    return ImageFolderSource(
        files, str(folder), fps, first_number=1, expected_count=length, warn=warn
    )


def _open_video(path: Path, fps: float, length: int | None, warn: Warn) -> FrameSource:
    source = VideoFileSource(path, warn, fps)
    if length is not None and source.frame_count not in (None, length):
        warn(f"{path}: {source.frame_count} frames, but {SEQUENCE_FILE} says {length}")
    return source


def _read_section(path: Path) -> dict[str, str]:
    parser = configparser.ConfigParser(interpolation=None)
    parser.optionxform = str  # type: ignore[assignment, method-assign]  # keys are camel case
    try:
        parser.read_string(path.read_text(encoding="utf-8-sig"))
        return dict(parser["Sequence"])
    except (configparser.Error, KeyError, UnicodeDecodeError, OSError) as error:
        reason = " ".join(str(error).split())
        raise SourceError(
            f"{path}: not a MOTChallenge sequence file ({reason}); give imDir, imExt and "
            "frameRate under [Sequence]"
        ) from error


def _number(section: dict[str, str], key: str, folder: Path) -> float:
    """The value of `key`, 0 when absent."""
    text = section.get(key, "0")
    if not re.fullmatch(r"\d{1,9}(\.\d*)?", text):
        raise SourceError(f"{folder / SEQUENCE_FILE}: {key}={text} is not a number; correct it")
    return float(text)
