"""MOTChallenge sequence directories: `seqinfo.ini` beside the pictures or the video it names."""

from __future__ import annotations

import re
from pathlib import Path

from heel.schemas.errors import SourceError
from heel.services.capture.ffmpeg import shown_path
from heel.services.capture.image_folder import VIDEO_SUFFIXES, ImageFolderSource, list_images
from heel.services.capture.source import FrameSource, Warn, log_warning, plausible_fps
from heel.services.capture.video_file import VideoFileSource
from heel.services.sequence_file import SEQUENCE_FILE, read_sequence_file, sequence_file


def open_sequence(folder: Path, warn: Warn = log_warning) -> FrameSource:
    """Open a MOTChallenge sequence (https://motchallenge.net/instructions/).

    `imDir` names the folder of pictures (default `img1`), `imExt` their suffix (default: any of a
    picture); large and small letters count alike. A video suffix
    (`.mp4`, `.avi`, ...) means one video file of that suffix in `imDir`, whose n-th frame is
    frame n.

    Raises:
        SourceError: `seqinfo.ini` cannot be parsed, or what it names is not there.
    """
    section = read_sequence_file(sequence_file(folder) or folder / SEQUENCE_FILE)
    pictures = _subfolder(folder, section.get("imdir", "img1").replace("\\", "/"))
    suffix = section.get("imext", "").lower()
    if suffix and not suffix.startswith("."):
        suffix = f".{suffix}"
    fps = plausible_fps(_number(section, "frameRate", folder), shown_path(folder), warn)
    length = int(_number(section, "seqLength", folder)) or None
    if not pictures.is_dir():
        raise SourceError(
            f"{folder}: {SEQUENCE_FILE} names imDir={pictures.name}, which is not there; "
            "this copy has no pictures"
        )
    if suffix in VIDEO_SUFFIXES:
        videos = sorted(path for path in pictures.iterdir() if path.suffix.lower() == suffix)
        if len(videos) != 1:
            raise SourceError(
                f"{pictures}: {len(videos)} {suffix} files where {SEQUENCE_FILE} means one; "
                "keep one or give the file itself"
            )
        return _open_video(videos[0], fps, length, warn)
    files = list_images(pictures, suffix or None)
    return ImageFolderSource(
        files, shown_path(folder), fps, first_number=1, expected_count=length, warn=warn
    )


def _open_video(path: Path, fps: float, length: int | None, warn: Warn) -> FrameSource:
    source = VideoFileSource(path, warn, fps)
    if length is not None and source.frame_count not in (None, length):
        warn(f"{path}: {source.frame_count} frames, but {SEQUENCE_FILE} says {length}")
    return source


def _subfolder(folder: Path, name: str) -> Path:
    """The folder of a name, in whatever case it is written on the disk."""
    path = folder / name
    if path.is_dir():
        return path
    found = [one for one in folder.iterdir() if one.name.lower() == name.lower() and one.is_dir()]
    return min(found, default=path)


def _number(section: dict[str, str], key: str, folder: Path) -> float:
    """The value of `key`, 0 when absent."""
    text = section.get(key.lower(), "0")
    if not re.fullmatch(r"\d{1,9}(\.\d*)?", text):
        raise SourceError(f"{folder / SEQUENCE_FILE}: {key}={text} is not a number; correct it")
    return float(text)
