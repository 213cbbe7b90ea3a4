"""Numbers that are well-formed and cannot be meant: boxes and frames of another convention."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from heel.evaluation.rows import BoxRows
from heel.schemas.errors import HeelError

MOST_FRAMES_WITHOUT_BOXES = 100_000
"""One hour at 25 frames a second: what a detector finds is seldom so little, and a mistyped frame
number costs minutes."""
MOST_FRAMES_WITHOUT_TRACKS = 1_000_000
"""Eleven hours at 25 frames a second: tracks may be rarer than boxes."""
_MOST_SHARE = 1.0
"""Largest width or height of boxes that are shares of the picture: all of it."""
_MOST_PLACE = 2.0
"""And their farthest corner: a picture's size outside of it."""
_REACH = 1.02
"""Boxes of people at the border end outside of the picture, by so much of its size at most; chosen
by hand."""
_FAR_SHARE = 0.3
"""Share of boxes that reach farther, from which all of them are doubted; chosen by hand."""
_OUTSIDE_SHARE = 0.5
"""Share of boxes whose middle lies outside, from which they are of other pictures: most."""
_CORNERS_CORRELATION = 0.9
"""Right and bottom edges correlate with left and top ones, which widths and heights hardly do;
chosen by hand."""
_LEAST_ROWS = 10
"""Fewer rows can correlate by chance; chosen by hand."""
_OTHER_SIZE = 1.5
"""Ratio of two files' extents in every direction from which they are of pictures of different
sizes; chosen by hand."""

_log = logging.getLogger("heel.evaluation")

Numbers = NDArray[np.float64]


def check_units(table: Numbers, places: NDArray[np.int64], where: str) -> None:
    """Boxes are in pixels, with a size.

    Args:
        table: (N, >=6) frame, identity, left, top, width, height.
        places: (N,) line of each row.
        where: what `places` counts.

    Raises:
        HeelError: all of them lie within 0..1.
    """
    corner, size = table[:, 2:4], table[:, 4:6]
    if len(table) and size.max() <= _MOST_SHARE and np.abs(corner).max() <= _MOST_PLACE:
        box = ",".join(f"{value:g}" for value in table[0, 2:6])
        raise HeelError(
            f"{where} {places[0]}: box {box}: all boxes lie within 0 to 1, as shares of the "
            "picture (YOLO's, with the middle for a corner?): give left, top, width and height in "
            "pixels"
        )
    if len(table) >= _LEAST_ROWS and _look_like_corners(corner, size):
        both = (_correlation(corner[:, axis], size[:, axis]) for axis in (0, 1))
        if all(value > _CORNERS_CORRELATION for value in both):
            _log.warning(
                "%s %d: boxes look like left,top,right,bottom, and are read as "
                "left,top,width,height",
                where, places[0],
            )  # fmt: skip


def check_size(rows: BoxRows, size: tuple[int, int], where: str) -> None:
    """Boxes fit a picture of this size.

    Args:
        rows: of a file.
        size: width and height of the pictures, pixels.
        where: the file.

    Raises:
        HeelError: they are corners in place of sizes, or of larger pictures.
    """
    if not len(rows):
        return
    picture = np.array(size, np.float64)
    corner, end = rows.boxes_xyxy[:, :2], rows.boxes_xyxy[:, 2:]
    extent = end - corner
    shown = f"{size[0]}x{size[1]}"
    reach = "x".join(f"{value:.0f}" for value in end.max(axis=0))
    far = (end > picture * _REACH).any(axis=1).mean() > _FAR_SHARE
    if far and (extent <= picture * _REACH).all() and _look_like_corners(corner, extent):
        raise HeelError(
            f"{where}: boxes reach to {reach} in pictures of {shown}, and look like "
            "left,top,right,bottom: write width and height in columns 5 and 6"
        )
    middle = (corner + end) / 2
    if ((middle > picture) | (middle < 0)).any(axis=1).mean() > _OUTSIDE_SHARE:
        raise HeelError(
            f"{where}: boxes reach to {reach}, most of them outside of pictures of {shown}: scale "
            "them, or give the size of the pictures that they were made on"
        )


def check_frames(
    table: Numbers, places: NDArray[np.int64], where: str, most: int = MOST_FRAMES_WITHOUT_BOXES
) -> None:
    """There is no gap as a mistyped frame number makes.

    Args:
        table: (N, >=1) frame numbers in the first column, all valid, N > 0.
        places: (N,) line of each row.
        where: what `places` counts.
        most: frames without a box that may follow one another.

    Raises:
        HeelError: there is one.
    """
    order = np.argsort(table[:, 0], kind="stable")
    frames = np.concatenate([[0.0], table[order, 0]])
    gaps = np.diff(frames)
    if gaps.max() > most:
        at = int(np.argmax(gaps))
        raise HeelError(
            f"{where} {places[order[at]]}: frame {frames[at + 1]:.0f} after nobody since frame "
            f"{frames[at]:.0f}, for more than {most} frames: correct the "
            "number, or split the file"
        )


def warn_of_another_size(truth: BoxRows, tracks: BoxRows, where: str) -> None:
    """Say so where tracks look like those of the same scene in pictures of another size.

    Args:
        truth: what was there.
        tracks: what was shown.
        where: the file of the tracks.
    """
    if not len(truth) or not len(tracks):
        return
    true, shown = (rows.boxes_xyxy[:, 2:].max(axis=0) for rows in (truth, tracks))
    ratio = shown / np.maximum(true, 1.0)
    if (ratio > _OTHER_SIZE).all() or (ratio < 1 / _OTHER_SIZE).all():
        _log.warning(
            "%s: boxes reach to %.0fx%.0f, those of the ground truth to %.0fx%.0f: made on "
            "pictures of the same size?", where, *shown, *true,
        )  # fmt: skip


def _look_like_corners(corner: Numbers, size: Numbers) -> bool:
    return bool((size > corner).all())


def _correlation(a: Numbers, b: Numbers) -> float:
    return float(np.corrcoef(a, b)[0, 1]) if np.std(a) > 0 and np.std(b) > 0 else 0.0
