"""MOTA, MOTP, IDF1 and HOTA, equal to TrackEval's (a test compares them on drawn and real files).

TrackEval itself is not used: its wheel brings an OpenCV with windows that overwrites the one
without. py-motmetrics is not used because it re-instates any earlier pairing, not only that of the
frame before, and so counts fewer switches than the MOTChallenge devkit.

Sources: CLEAR MOT, Bernardin & Stiefelhagen, EURASIP JIVP 2008; IDF1, Ristani et al., ECCV-W 2016;
HOTA, Luiten et al., IJCV 2020; the rules of TrackEval 1.3.0,
https://github.com/JonathonLuiten/TrackEval.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.evaluation.alignment import (
    EPSILON,
    AlignedFrame,
    AlignedSequence,
    best_pairs,
    check_iou_threshold,
)
from heel.services.geometry.assignment import heaviest_pairs

_ALPHAS = np.arange(0.05, 0.99, 0.05)
"""Thresholds of overlap over which HOTA is averaged: 0.05 to 0.95, the definition's."""
_NOBODY = -1
"""Identities are numbered from 0."""


@dataclass(frozen=True, slots=True)
class TrackingScores:
    """The numbers of one sequence: percent, except the counts.

    Attributes:
        mota: 100 (1 - (FN + FP + IDsw) / boxes); unbounded below.
        motp: mean IoU of the matched boxes; 0 without matches.
        idf1: F1 of the best fixed pairing of people and track identities.
        hota: mean over the 19 IoU thresholds 0.05 to 0.95 (``iou_threshold`` has no say in it).
        idsw: identity switches.
        fp: output boxes without a person.
        fn: true boxes without an output.
        boxes: true boxes.
    """

    mota: float
    motp: float
    idf1: float
    hota: float
    idsw: int
    fp: int
    fn: int
    boxes: int


@dataclass(frozen=True, slots=True)
class _Pairing:
    """Counts of CLEAR MOT, and the sum of the IoU of the matched boxes."""

    matched: int
    switches: int
    iou: float


def tracking_scores(sequence: AlignedSequence, iou_threshold: float = 0.5) -> TrackingScores:
    """Scores one aligned sequence.

    Args:
        sequence: at least one true box.
        iou_threshold: a pair counts as a match from this IoU on, in CLEAR and IDF1.

    Raises:
        HeelError: the threshold is outside (0, 1].
    """
    check_iou_threshold(iou_threshold)
    true, shown = _lengths(sequence)
    boxes, outputs = int(true.sum()), int(shown.sum())
    pairs = _pair_as_clear(sequence, iou_threshold)
    fp, fn = outputs - pairs.matched, boxes - pairs.matched
    return TrackingScores(
        mota=100.0 * (pairs.matched - fp - pairs.switches) / max(1, boxes),
        motp=100.0 * pairs.iou / max(1, pairs.matched),
        idf1=100.0 * 2 * _identity_matches(sequence, iou_threshold) / max(1, boxes + outputs),
        hota=100.0 * _hota(sequence, true, shown),
        idsw=pairs.switches,
        fp=fp,
        fn=fn,
        boxes=boxes,
    )


def _lengths(sequence: AlignedSequence) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Boxes of every person and of every output identity."""
    true = np.zeros(len(sequence.gt_identities), np.int64)
    shown = np.zeros(len(sequence.track_identities), np.int64)
    for frame in sequence.frames:
        true[frame.gt] += 1
        shown[frame.tracks] += 1
    return true, shown


def _pair_as_clear(sequence: AlignedSequence, iou_threshold: float) -> _Pairing:
    """Pairs frame by frame: that of the frame before first, then the highest total IoU."""
    before = np.full(len(sequence.gt_identities), _NOBODY)
    last = before.copy()
    matched, switches, iou = 0, 0, 0.0
    for frame in _with_both(sequence):
        preferred = before[frame.gt][:, None] == frame.tracks[None, :]
        rows, columns = best_pairs(frame.iou, iou_threshold, preferred)
        person, track = frame.gt[rows], frame.tracks[columns]
        switches += int(((last[person] != _NOBODY) & (last[person] != track)).sum())
        matched += len(rows)
        iou += float(frame.iou[rows, columns].sum())
        last[person] = track
        before[:] = _NOBODY
        before[person] = track
    return _Pairing(matched, switches, iou)


def _identity_matches(sequence: AlignedSequence, iou_threshold: float) -> int:
    """Boxes matched under the best fixed pairing of people and output identities."""
    together = np.zeros((len(sequence.gt_identities), len(sequence.track_identities)))
    for frame in _with_both(sequence):
        together[np.ix_(frame.gt, frame.tracks)] += frame.iou >= iou_threshold
    rows, columns = heaviest_pairs(together)
    return int(together[rows, columns].sum())


def _hota(
    sequence: AlignedSequence, true: NDArray[np.int64], shown: NDArray[np.int64]
) -> float:  # fmt: skip
    """Mean over the IoU thresholds of the geometric mean of detection and association."""
    boxes = true[:, None] + shown[None, :]
    alike = np.zeros(boxes.shape)
    for frame in _with_both(sequence):
        alike[np.ix_(frame.gt, frame.tracks)] += _share_of_overlap(frame.iou)
    alignment = alike / (boxes - alike)
    matches = np.zeros((len(_ALPHAS), *boxes.shape))
    for frame in _with_both(sequence):
        score = alignment[np.ix_(frame.gt, frame.tracks)] * frame.iou
        rows, columns = heaviest_pairs(score)
        enough = frame.iou[rows, columns][None, :] >= _ALPHAS[:, None] - EPSILON
        matches[:, frame.gt[rows], frame.tracks[columns]] += enough
    found = matches.sum(axis=(1, 2))
    association = (matches * (matches / np.maximum(1, boxes - matches))).sum(axis=(1, 2))
    detection = found / np.maximum(1, true.sum() + shown.sum() - found)
    return float(np.sqrt(detection * association / np.maximum(1, found)).mean())


def _share_of_overlap(iou: NDArray[np.float64]) -> NDArray[np.float64]:
    """Each pair's IoU over all that its two boxes have in that frame."""
    total = iou.sum(axis=0)[None, :] + iou.sum(axis=1)[:, None] - iou
    share: NDArray[np.float64] = np.zeros_like(iou)
    np.divide(iou, total, out=share, where=total > EPSILON)
    return share


def _with_both(sequence: AlignedSequence) -> list[AlignedFrame]:
    """Frames with true and output boxes; in others nothing can match, and pairings stay."""
    return [frame for frame in sequence.frames if len(frame.gt) and len(frame.tracks)]
