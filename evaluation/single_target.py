"""Scores of following one person whose true box is known, as object tracking benchmarks give them.

Success and precision: Y. Wu, J. Lim, M.-H. Yang, "Online Object Tracking: A Benchmark", CVPR 2013.
Heel is given no box: a user chooses an identity among the tracks that are shown. So the
identity is chosen in the first frame in which a shown box is on the target, by the true box, and
held to the end; frames before that and frames in which it is not shown count as missed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.evaluation.alignment import check_iou_threshold
from heel.evaluation.rows import BoxRows
from heel.schemas.errors import HeelError
from heel.services.geometry.boxes import iou, iou_matrix

ELSEWHERE_IOU = 0.2
"""A box that overlaps the target less than this is on something else, most often somebody else."""
PRECISION_PX = 20.0
"""Of the source's picture: the threshold of OTB's precision plot, by which trackers are ranked."""
_SUCCESS_IOUS = np.linspace(0.0, 1.0, 21)
"""Thresholds of OTB's success plot, whose mean is the area under it."""


@dataclass(frozen=True, slots=True)
class SingleTargetScores:
    """What became of the identity chosen for one target, percent of the target's frames.

    Attributes:
        identity: the one that was chosen, None if the target never had a box.
        frames: frames in which the target is to be seen.
        on_target: its box overlaps the target by at least the threshold.
        elsewhere: its box overlaps the target by less than `ELSEWHERE_IOU`.
        success_auc: mean over the thresholds 0, 0.05, ... 1 of the share of frames whose IoU is
            larger.
        precision: the centre of its box is within `PRECISION_PX` of the target's.
    """

    identity: int | None
    frames: int
    on_target: float
    elsewhere: float
    success_auc: float
    precision: float


def single_target_scores(
    gt: BoxRows, tracks: BoxRows, iou_threshold: float = 0.5
) -> SingleTargetScores:
    """Follow the one person of `gt` by the identity that is first on them.

    Args:
        gt: true boxes of one identity.
        tracks: what was shown.
        iou_threshold: from this IoU on a box is on the target.

    Raises:
        HeelError: the threshold is outside (0, 1], or `gt` is empty or of several people.
    """
    check_iou_threshold(iou_threshold)
    if len(np.unique(gt.identities)) != 1:
        raise HeelError(
            f"ground truth of {len(np.unique(gt.identities))} people; select the rows of one"
        )
    identity = _chosen(gt, tracks, iou_threshold)
    if identity is None:
        return SingleTargetScores(None, len(gt), 0.0, 0.0, 0.0, 0.0)
    held = tracks.select(tracks.identities == identity)
    place = {frame: row for row, frame in enumerate(held.frames.tolist())}
    rows = np.array([place.get(frame, -1) for frame in gt.frames.tolist()])
    there = rows >= 0
    true, shown = gt.boxes_xyxy[there], held.boxes_xyxy[rows[there]]
    overlap = np.zeros(len(gt))
    overlap[there] = _overlaps(true, shown)
    distance = np.full(len(gt), np.inf)
    distance[there] = np.linalg.norm(_centres(true) - _centres(shown), axis=1)
    return SingleTargetScores(
        identity,
        len(gt),
        on_target=_percent(overlap >= iou_threshold),
        elsewhere=_percent(there & (overlap < ELSEWHERE_IOU)),
        success_auc=float(np.mean([_percent(overlap > least) for least in _SUCCESS_IOUS])),
        precision=_percent(distance <= PRECISION_PX),
    )


def _chosen(gt: BoxRows, tracks: BoxRows, iou_threshold: float) -> int | None:
    for frame, box in zip(gt.frames.tolist(), gt.boxes_xyxy, strict=True):
        here = tracks.select(tracks.frames == frame)
        if len(here) == 0:
            continue
        overlap = iou_matrix(box[None], here.boxes_xyxy)[0]
        if overlap.max() >= iou_threshold:
            return int(here.identities[int(overlap.argmax())])
    return None


def _overlaps(a_xyxy: NDArray[np.float64], b_xyxy: NDArray[np.float64]) -> NDArray[np.float64]:
    """IoU of every row with the same row."""
    rows = zip(a_xyxy.tolist(), b_xyxy.tolist(), strict=True)
    return np.array([iou(box, other) for box, other in rows])


def _centres(boxes_xyxy: NDArray[np.float64]) -> NDArray[np.float64]:
    return (boxes_xyxy[:, :2] + boxes_xyxy[:, 2:]) / 2


def _percent(mask: NDArray[np.bool_]) -> float:
    return 100.0 * float(np.mean(mask))
