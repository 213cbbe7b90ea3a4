"""Ground truth and tracks side by side, frame by frame: what every score starts from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from heel.evaluation.rows import BoxRows
from heel.schemas.errors import HeelError
from heel.services.geometry.assignment import heaviest_pairs
from heel.services.geometry.boxes import iou_matrix

FlagRule = Literal["mot15", "ignore", "all"]
"""What ground-truth rows with flag 0 mean.

``mot15``: they are not ground truth at all; an output on such a person is a false positive. This
    is the MOT15 protocol and what TrackEval does without preprocessing.
``ignore``: they are ignore regions. Per frame, outputs are matched to *all* rows, flagged or not,
    one to one at the highest total IoU; an output whose partner is a flag-0 row is removed before
    scoring, the flag-0 rows with it. Matching all rows at once keeps an ignored person from taking
    the output of a scored one. This is what TrackEval does with distractors from MOT16 on.
``all``: the flag is not looked at; every row is ground truth.
"""

EPSILON = float(np.finfo(np.float64).eps)  # TrackEval's tolerance at the threshold


@dataclass(frozen=True, slots=True)
class AlignedFrame:
    """The boxes of one frame.

    Attributes:
        frame: number from 1.
        gt: ``(G,)`` int64, index of each true box's person in ``AlignedSequence.gt_identities``.
        tracks: ``(T,)`` int64, index into ``AlignedSequence.track_identities``.
        gt_xyxy: ``(G, 4)`` float64 pixels, top-left origin.
        tracks_xyxy: ``(T, 4)`` float64 pixels, top-left origin.
        iou: ``(G, T)`` float64, 0 to 1.
    """

    frame: int
    gt: NDArray[np.int64]
    tracks: NDArray[np.int64]
    gt_xyxy: NDArray[np.float64]
    tracks_xyxy: NDArray[np.float64]
    iou: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class AlignedSequence:
    """A sequence ready to be scored.

    Attributes:
        name: the sequence's name.
        frame_count: frames 1 to ``frame_count`` are evaluated.
        gt_identities: ``(P,)`` int64, the people's identities in the file, ascending.
        track_identities: ``(K,)`` int64, the outputs' identities in the file, ascending.
        frames: the frames that hold any box, ascending.
    """

    name: str
    frame_count: int
    gt_identities: NDArray[np.int64]
    track_identities: NDArray[np.int64]
    frames: tuple[AlignedFrame, ...]


def align(
    gt: BoxRows,
    tracks: BoxRows,
    *,
    name: str = "",
    frame_count: int = 0,
    iou_threshold: float = 0.5,
    flags: FlagRule = "mot15",
) -> AlignedSequence:
    """Applies the flag rule and pairs up the frames.

    Args:
        gt: ground truth; ``values`` are the flags.
        tracks: outputs.
        name: the sequence's name, for reports.
        frame_count: the sequence's length if known. Evaluated are frames 1 to the largest of this,
            the last ground-truth frame and the last track frame: outputs after the end of the
            ground truth are false positives, not silently dropped.
        iou_threshold: 0 < threshold <= 1, used by ``flags="ignore"`` only.
        flags: what flag 0 means.

    Raises:
        HeelError: the threshold or rule is not valid, or no ground truth is left to score against.
    """
    check_iou_threshold(iou_threshold)
    if flags not in get_args(FlagRule):
        raise HeelError(f"flags = {flags!r}; choose one of {', '.join(get_args(FlagRule))}")
    last_frame = max(frame_count, *(int(rows.frames.max(initial=0)) for rows in (gt, tracks)))
    flagged = np.zeros(len(gt), dtype=np.bool_) if flags == "all" else gt.values == 0
    if flags == "ignore":
        tracks = _without_ignored(gt, flagged, tracks, iou_threshold)
    gt = gt.select(~flagged)
    if len(gt) == 0:
        raise HeelError(
            f"{name or 'sequence'}: none of {len(flagged)} ground-truth rows is left with "
            f"flags={flags!r}; use flags='all' or another ground truth"
        )
    gt_identities, gt_index = np.unique(gt.identities, return_inverse=True)
    track_identities, track_index = np.unique(tracks.identities, return_inverse=True)
    frames = _aligned_frames(gt, gt_index, tracks, track_index)
    return AlignedSequence(name, last_frame, gt_identities, track_identities, frames)


def check_iou_threshold(iou_threshold: float) -> None:
    """Refuses thresholds outside (0, 1].

    Raises:
        HeelError: it is outside.
    """
    if not 0.0 < iou_threshold <= 1.0:
        raise HeelError(f"iou_threshold = {iou_threshold!r}; it must lie in (0, 1], usually 0.5")


def best_pairs(
    iou: NDArray[np.float64],
    iou_threshold: float,
    preferred: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """One-to-one pairs above the threshold with the highest total IoU (Kuhn-Munkres).

    Args:
        iou: ``(G, T)`` float64.
        iou_threshold: pairs below it never match.
        preferred: ``(G, T)`` pairs to keep before IoU is looked at (CLEAR's rule for the pairing of
            the frame before).

    Returns:
        Row indices and column indices of the pairs, equally long.
    """
    score = iou if preferred is None else iou + 1000.0 * preferred
    score = np.where(iou < iou_threshold - EPSILON, 0.0, score)
    rows, columns = heaviest_pairs(score, above=EPSILON)
    return rows.astype(np.int64), columns.astype(np.int64)


def _aligned_frames(
    gt: BoxRows,
    gt_index: NDArray[np.int64],
    tracks: BoxRows,
    track_index: NDArray[np.int64],
) -> tuple[AlignedFrame, ...]:
    return tuple(
        AlignedFrame(
            frame=frame,
            gt=gt_index[gt_rows],
            tracks=track_index[track_rows],
            gt_xyxy=gt.boxes_xyxy[gt_rows],
            tracks_xyxy=tracks.boxes_xyxy[track_rows],
            iou=iou_matrix(gt.boxes_xyxy[gt_rows], tracks.boxes_xyxy[track_rows]),
        )
        for frame, gt_rows, track_rows in _by_frame(gt, tracks)
    )


def _by_frame(gt: BoxRows, tracks: BoxRows) -> list[tuple[int, slice, slice]]:
    """Frame numbers that hold anything, with the row ranges of both sides (rows are sorted)."""
    numbers = np.union1d(gt.frames, tracks.frames)
    bounds = [
        (np.searchsorted(rows.frames, numbers), np.searchsorted(rows.frames, numbers, "right"))
        for rows in (gt, tracks)
    ]
    (gt_start, gt_stop), (track_start, track_stop) = bounds
    return [
        (int(frame), slice(gt_start[i], gt_stop[i]), slice(track_start[i], track_stop[i]))
        for i, frame in enumerate(numbers)
    ]


def _without_ignored(
    gt: BoxRows, flagged: NDArray[np.bool_], tracks: BoxRows, iou_threshold: float
) -> BoxRows:
    keep = np.ones(len(tracks), dtype=np.bool_)
    for _, gt_rows, track_rows in _by_frame(gt, tracks):
        iou = iou_matrix(gt.boxes_xyxy[gt_rows], tracks.boxes_xyxy[track_rows])
        rows, columns = best_pairs(iou, iou_threshold)
        keep[track_rows.start + columns[flagged[gt_rows][rows]]] = False
    return tracks.select(keep)
