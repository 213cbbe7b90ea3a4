"""Boxes of one sequence as columns of numbers, checked once and then trusted by every score."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from heel.schemas.errors import HeelError

RowKind = Literal["ground truth", "detections", "tracks"]

MAX_FRAME = 10_000_000
"""Largest frame number accepted: four days at 30 fps. Arrays over all frames still fit in memory,
so a mistyped row ends in an error and not in a machine that swaps."""

MAX_IDENTITY = 2**53
"""Beyond this a float64 column can no longer tell two neighbouring identities apart."""

MAX_PX = 1e6
"""Largest coordinate or size; larger numbers are broken rows, and their areas lose precision."""

MIN_SIZE_PX = 1e-3
"""Smallest width or height, the last digit that ``tracks.txt`` keeps; below it areas vanish."""

COLUMNS = "frame,id,left,top,width,height,confidence"


@dataclass(frozen=True, slots=True)
class BoxRows:
    """Boxes of one sequence, one row per box, sorted by frame and then identity.

    Build it with ``rows_from_xyxy``, or read it from a file: both check what is promised here.

    Attributes:
        frames: ``(N,)`` int64, frame numbers from 1.
        identities: ``(N,)`` int64 from 0, unique within a frame; -1 throughout for detections.
        boxes_xyxy: ``(N, 4)`` float64 pixels, origin 0 at the image's top left, positive area.
        values: ``(N,)`` float64: the flag of ground truth, the confidence of everything else.
    """

    frames: NDArray[np.int64]
    identities: NDArray[np.int64]
    boxes_xyxy: NDArray[np.float64]
    values: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.frames)

    def select(self, mask: NDArray[np.bool_]) -> BoxRows:
        """The rows where ``mask`` ``(N,)`` is true, in the same order."""
        return BoxRows(
            self.frames[mask], self.identities[mask], self.boxes_xyxy[mask], self.values[mask]
        )


def rows_from_xyxy(
    frames: Iterable[int],
    identities: Iterable[int],
    boxes_xyxy: NDArray[np.floating[Any]],
    values: Iterable[float] | None = None,
    kind: RowKind = "tracks",
) -> BoxRows:
    """Rows from Heel's own boxes.

    Args:
        frames: N frame numbers from 1.
        identities: N identities from 0.
        boxes_xyxy: ``(N, 4)`` float pixels, origin 0 at the image's top left.
        values: N confidences or flags; 1 when not given.
        kind: what the rows are.

    Raises:
        HeelError: a row is wrong; the message holds the value and the row from 1.
    """
    boxes = np.asarray(boxes_xyxy, dtype=np.float64).reshape(-1, 4)
    table = np.ones((len(boxes), 7))
    table[:, 0] = list(frames)
    table[:, 1] = list(identities)
    table[:, 2:4] = boxes[:, :2] + 1.0
    table[:, 4:6] = boxes[:, 2:] - boxes[:, :2]
    if values is not None:
        table[:, 6] = list(values)
    return check_rows(table, np.arange(1, len(table) + 1), kind, f"{kind}: row")


def check_rows(
    table: NDArray[np.float64], places: NDArray[np.int64], kind: RowKind, where: str
) -> BoxRows:
    """The rows of ``table``, or the error that a user needs to mend them.

    Args:
        table: ``(N, 7)`` file columns in file pixels; not changed.
        places: ``(N,)`` line or row number of each row, for messages.
        kind: what the rows are; detections have no identity.
        where: what ``places`` counts, e.g. ``"tracks.txt: line"``.

    Raises:
        HeelError: a number is not finite, a frame or identity is not a whole number in range, a
            box has no area or absurd coordinates, or an identity appears twice in a frame.
    """
    frame, identity, size = table[:, 0:1], table[:, 1:2], table[:, 4:6]
    if kind == "detections":
        identity = np.full_like(identity, -1.0)
    _reject(~np.isfinite(table), table, places, where, "is not finite; correct or remove it")
    bad = (frame < 1) | (frame > MAX_FRAME) | (frame != np.floor(frame))
    _reject(bad, frame, places, where, "is not a frame number; frames count from 1")
    _reject(size < MIN_SIZE_PX, size, places, where, "is not a size; give positive pixels")
    box = table[:, 2:6]
    _reject(np.abs(box) > MAX_PX, box, places, where, f"is not in pixels; the limit is {MAX_PX:g}")
    order = np.lexsort((identity[:, 0], frame[:, 0]))
    if kind != "detections":
        bad = (identity < 0) | (identity > MAX_IDENTITY) | (identity != np.floor(identity))
        remedy = "identities are whole numbers from 0 (detections have none: run a tracker first)"
        _reject(bad, identity, places, where, f"is not an identity; {remedy}")
        _reject_duplicates(table, order, places, where)
    corner = table[order, 2:4] - 1.0
    return BoxRows(
        frames=frame[order, 0].astype(np.int64),
        identities=identity[order, 0].astype(np.int64),
        boxes_xyxy=np.hstack([corner, corner + size[order]]),
        values=table[order, 6],
    )


def _reject(
    bad: NDArray[np.bool_],
    values: NDArray[np.float64],
    places: NDArray[np.int64],
    where: str,
    problem: str,
) -> None:
    if bad.any():
        row, column = np.argwhere(bad)[0]
        raise HeelError(f"{where} {places[row]}: {values[row, column]:.15g} {problem}")


def _reject_duplicates(
    table: NDArray[np.float64],
    order: NDArray[np.intp],
    places: NDArray[np.int64],
    where: str,
) -> None:
    same = (np.diff(table[order, :2], axis=0) == 0).all(axis=1)
    if same.any():
        index = int(np.argmax(same))
        first, second = sorted(int(places[row]) for row in order[index : index + 2])
        frame, identity = table[order[index], :2].astype(np.int64)
        raise HeelError(
            f"{where} {second}: identity {identity} is in frame {frame} twice (also {first}); "
            "keep one box per identity and frame"
        )
