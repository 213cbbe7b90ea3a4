"""MOTA, MOTP, IDF1 and HOTA, computed by TrackEval's own metric classes.

Only the metric classes of TrackEval are used; files are read and boxes compared here, so that one
set of rules (flags, threshold, evaluated frames) holds for all of Heel's numbers. py-motmetrics is
not used because it re-instates any earlier pairing, not only that of the frame before, and so
counts fewer switches than the MOTChallenge devkit.

Sources: CLEAR MOT, Bernardin & Stiefelhagen, EURASIP JIVP 2008; IDF1, Ristani et al., ECCV-W 2016;
HOTA, Luiten et al., IJCV 2020; TrackEval 1.3.0, https://github.com/JonathonLuiten/TrackEval.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from evaluation.alignment import AlignedSequence, check_iou_threshold
from schemas.errors import HeelError


@dataclass(frozen=True, slots=True)
class TrackingScores:
    """TrackEval's numbers for one sequence: percent, except the counts.

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


def tracking_scores(sequence: AlignedSequence, iou_threshold: float = 0.5) -> TrackingScores:
    """Scores one aligned sequence.

    Args:
        sequence: at least one true box.
        iou_threshold: a pair counts as a match from this IoU on, in CLEAR and IDF1.

    Raises:
        HeelError: TrackEval is not installed.
    """
    check_iou_threshold(iou_threshold)
    metrics = _trackeval_metrics()
    data = _trackeval_data(sequence)
    config = {"THRESHOLD": iou_threshold, "PRINT_CONFIG": False}
    clear = metrics.CLEAR(dict(config)).eval_sequence(data)
    identity = metrics.Identity(dict(config)).eval_sequence(data)
    hota = metrics.HOTA().eval_sequence(data)
    return TrackingScores(
        mota=100.0 * float(clear["MOTA"]),
        motp=100.0 * float(clear["MOTP"]),
        idf1=100.0 * float(identity["IDF1"]),
        hota=100.0 * float(np.mean(hota["HOTA"])),
        idsw=int(clear["IDSW"]),
        fp=int(clear["CLR_FP"]),
        fn=int(clear["CLR_FN"]),
        boxes=int(data["num_gt_dets"]),
    )


def _trackeval_metrics() -> ModuleType:
    try:
        return importlib.import_module("trackeval.metrics")
    except ImportError as error:
        raise HeelError(
            f"TrackEval cannot be imported ({error}); run `pip install --no-deps trackeval` and "
            "`pip install pycocotools tabulate` (without --no-deps it would replace "
            "opencv-python-headless with opencv-python)"
        ) from error


def _trackeval_data(sequence: AlignedSequence) -> dict[str, Any]:
    """The dictionary that TrackEval's data-set classes hand to its metrics."""
    frames = sequence.frames
    return {
        "num_timesteps": sequence.frame_count,
        "num_gt_ids": len(sequence.gt_identities),
        "num_tracker_ids": len(sequence.track_identities),
        "num_gt_dets": sum(len(frame.gt) for frame in frames),
        "num_tracker_dets": sum(len(frame.tracks) for frame in frames),
        "gt_ids": [frame.gt for frame in frames],
        "tracker_ids": [frame.tracks for frame in frames],
        "similarity_scores": [frame.iou for frame in frames],
    }
