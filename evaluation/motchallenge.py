"""MOTChallenge text files: ground truth, detections, tracks and ``seqinfo.ini``.

The files count pixels from 1 and give a size; everything inside Heel counts from 0 and gives
corners (``xyxy``). Only this module and ``rows`` know:
``left = x1 + 1, top = y1 + 1, width = x2 - x1, height = y2 - y1``.

Format: Leal-Taixe et al., "MOTChallenge 2015: Towards a Benchmark for Multi-Target Tracking",
arXiv:1504.01942.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from heel.evaluation.classes import people_by_class
from heel.evaluation.plausible import (
    MOST_FRAMES_WITHOUT_BOXES,
    MOST_FRAMES_WITHOUT_TRACKS,
    check_frames,
    check_units,
)
from heel.evaluation.rows import COLUMNS, MAX_FRAME, BoxRows, RowKind, check_rows
from heel.schemas.errors import HeelError
from heel.services.sequence_file import SEQUENCE_FILE, read_sequence_file, sequence_file

_log = logging.getLogger("heel.evaluation")
_MORE = 3
"""Columns behind the seventh that are read: class, visibility and a third, by which VisDrone is
told."""
_REQUIRED_COLUMNS: dict[RowKind, int] = {"ground truth": 7, "detections": 7, "tracks": 6}
"""Fewer are no row: up to the confidence (or the flag), which tracks may leave out."""


@dataclass(frozen=True, slots=True)
class SequenceInfo:
    """What ``seqinfo.ini`` says about a sequence; ``None`` where it says nothing.

    Attributes:
        name: the sequence's name.
        frame_count: number of frames (``seqLength``).
        frame_rate_fps: frames per second.
        width_px: image width.
        height_px: image height.
    """

    name: str
    frame_count: int
    frame_rate_fps: float | None
    width_px: int | None
    height_px: int | None


def ground_truth_file(path: Path) -> Path:
    """The ``gt.txt`` meant by ``path``: a sequence directory (holding ``gt/gt.txt``) or the file.

    Raises:
        HeelError: there is no such file.
    """
    file = path / "gt" / "gt.txt" if path.is_dir() else path
    if not file.is_file():
        raise HeelError(
            f"{file}: no such file; give a sequence directory that holds gt/gt.txt, or the gt.txt"
        )
    return file


def read_ground_truth(path: Path) -> BoxRows:
    """People of a ``gt.txt``; ``values`` are the flags (column 7), flag 0 included.

    Where an eighth column says what each row is, only people are given, and those that MOTChallenge
    does not evaluate with flag 0 (see ``classes``).

    Raises:
        HeelError: the file is missing, empty or malformed (with value and line number).
    """
    return _read_rows(path, "ground truth")


def read_detections(path: Path) -> BoxRows:
    """People of a ``det.txt`` (see ``classes``); identities are -1 whatever the file says.

    Raises:
        HeelError: the file is missing, empty or malformed (with value and line number).
    """
    return _read_rows(path, "detections")


def read_tracks(path: Path) -> BoxRows:
    """All rows of a ``tracks.txt``. An empty file is a result: nobody was ever shown.

    Raises:
        HeelError: the file is missing or malformed (with value and line number).
    """
    return _read_rows(path, "tracks")


def format_track_row(
    frame: int, identity: int, box_xyxy: Sequence[float], confidence: float = 1.0
) -> str:
    """One line of ``tracks.txt`` without its newline; pixels and confidence with three decimals.

    Args:
        frame: frame number from 1.
        identity: from 0.
        box_xyxy: four float pixels, origin 0 at the image's top left.
        confidence: finite, by convention 0 to 1.

    Raises:
        HeelError: a number is not finite or out of range, or the box is too small to be written.
    """
    x1, y1, x2, y2 = box_xyxy
    pixels = [round(float(value), 3) for value in (x1 + 1, y1 + 1, x2 - x1, y2 - y1, confidence)]
    table = np.array([[frame, identity, *pixels]], dtype=np.float64)
    check_rows(table, np.array([frame]), "tracks", f"track {identity} in frame")
    return f"{frame},{identity}," + ",".join(f"{value:z.3f}" for value in pixels) + ",-1,-1,-1"


def write_tracks(path: Path, rows: BoxRows) -> None:
    """Writes a ``tracks.txt`` in order of frame and identity.

    Raises:
        HeelError: a row cannot be written (see ``format_track_row``) or the file cannot.
    """
    columns = zip(
        rows.frames.tolist(),
        rows.identities.tolist(),
        rows.boxes_xyxy.tolist(),
        rows.values.tolist(),
        strict=True,
    )
    text = "".join(format_track_row(*row) + "\n" for row in columns)
    try:
        path.write_text(text, encoding="ascii")
    except OSError as error:
        raise HeelError(f"{path}: cannot be written ({error.strerror})") from error


def read_sequence_info(path: Path) -> SequenceInfo:
    """A ``seqinfo.ini``, given as the file or as the sequence directory that holds it.

    Raises:
        HeelError: the file is missing or not of this format, or a number in it is not positive.
    """
    file = (sequence_file(path) or path / SEQUENCE_FILE) if path.is_dir() else path
    section = read_sequence_file(file)
    frame_count = _positive(section, "seqLength", file)
    if frame_count is None:
        raise HeelError(f"{file}: seqLength is missing; add the number of frames")
    width, height = (_positive(section, key, file) for key in ("imWidth", "imHeight"))
    return SequenceInfo(
        name=section.get("name", file.absolute().parent.name),
        frame_count=int(frame_count),
        frame_rate_fps=_positive(section, "frameRate", file),
        width_px=None if width is None else int(width),
        height_px=None if height is None else int(height),
    )


def _positive(section: dict[str, str], key: str, file: Path) -> float | None:
    text = section.get(key.lower())
    if text is None:
        return None
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0 < number <= MAX_FRAME:
        raise HeelError(f"{file}: {key} = {text}; give a positive number up to {MAX_FRAME}")
    return number


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise HeelError(f"{path}: not a text file ({error.reason}); check the path") from error
    except OSError as error:
        raise HeelError(f"{path}: cannot be read ({error.strerror}); check the path") from error


def _read_rows(path: Path, kind: RowKind) -> BoxRows:
    lines = _read_text(path).splitlines()
    places = [place for place, line in enumerate(lines, start=1) if line.strip()]
    if not places and kind != "tracks":
        raise HeelError(f"{path}: empty; a {kind} file has rows {COLUMNS},-1,-1,-1")
    numbers = [_parse_row(lines[place - 1], kind, f"{path}: line {place}") for place in places]
    table = np.array(numbers, dtype=np.float64).reshape(-1, 7)
    counts = {len(_fields(lines[place - 1])) for place in places}
    more = np.array([_more(lines[place - 1]) for place in places]).reshape(-1, _MORE)
    where, at = f"{path}: line", np.array(places, dtype=np.int64)
    rows = check_rows(table, at, kind, where)
    check_units(table, at, where)
    if places:
        most = MOST_FRAMES_WITHOUT_TRACKS if kind == "tracks" else MOST_FRAMES_WITHOUT_BOXES
        check_frames(table, at, where, most)
    people = people_by_class(counts.pop() if len(counts) == 1 else 0, more, at, kind, where)
    if people.kept.all() and not people.unscored.any():
        return rows
    table[people.unscored, 6] = 0.0
    left_out = int((~people.kept).sum())
    if left_out:
        _log.warning("%s: %d of %d rows are of other classes than people: left out", path,
                     left_out, len(table))  # fmt: skip
    return check_rows(table[people.kept], at[people.kept], kind, where)


def _fields(line: str) -> list[str]:
    """Columns of a row; a comma at its end begins none."""
    return line.strip().removesuffix(",").split(",")


def _more(line: str) -> list[float]:
    """Columns 8 to 10, NaN for what is missing or no number."""
    found = [math.nan] * _MORE
    for index, field in enumerate(_fields(line)[7 : 7 + _MORE]):
        with suppress(ValueError):
            found[index] = float(field)
    return found


def _parse_row(line: str, kind: RowKind, where: str) -> list[float]:
    fields = line.split(",")[:7]
    if len(fields) < _REQUIRED_COLUMNS[kind]:
        raise HeelError(
            f"{where}: {len(fields)} columns in {line.strip()[:60]!r}, {_REQUIRED_COLUMNS[kind]} "
            f"needed; {kind} rows are {COLUMNS},-1,-1,-1 with commas"
        )
    try:
        numbers = [float(field) for field in fields]
    except ValueError as error:
        raise HeelError(
            f"{where}: {error} in {line.strip()[:60]!r}; {kind} rows are {COLUMNS},-1,-1,-1"
        ) from error
    return [*numbers, 1.0] if len(numbers) < 7 else numbers
