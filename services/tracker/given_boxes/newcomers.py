"""Who may be somebody new: boxes that nobody has got, and who of them is near enough to count."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heel.services.geometry.boxes import iou_matrix
from heel.services.tracker.given_boxes import kalman
from heel.services.tracker.given_boxes.frame import FrameBoxes
from heel.services.tracker.given_boxes.track import Track
from heel.services.tracker.given_boxes.tuning import Tuning

_DUPLICATE_IOU = 0.5
"""Overlap with a track that has a box above which no track is born: detectors draw some twice."""


def newborn(
    frame: FrameBoxes, free: Sequence[int], known: Sequence[Track], t_s: float,
    tuning: Tuning,
) -> list[Track]:  # fmt: skip
    """A track for each box that nobody has got, surest first.

    Args:
        frame: the boxes.
        free: which of them nobody has got.
        known: everybody so far; who has a box in this frame is not begun twice.
        t_s: time of the frame.
        tuning: least score of a box that starts a track.
    """
    boxes, scores = frame.boxes, frame.scores
    seen = frame.measurements()
    taken = np.array([track.box() for track in known if track.seen_s == t_s]).reshape(-1, 4)
    made = []
    for j in sorted(free, key=lambda index: -scores[index]):
        doubled = len(taken) and iou_matrix(boxes[j : j + 1], taken).max() > _DUPLICATE_IOU
        if scores[j] < tuning.birth_score or doubled:
            continue
        mean, covariance = kalman.initial_state(seen[j : j + 1])
        made.append(Track.born(mean[0], covariance[0], float(scores[j]), t_s))
        made[-1].proven = bool(frame.proven[j])
        taken = np.concatenate([taken, boxes[j : j + 1]])
    return made


def near_enough(track: Track, everybody: Sequence[Track], least_px: float, tuning: Tuning) -> bool:
    """Whether a newcomer is tall enough, or nobody else who is so is in sight."""
    return track.height_px() >= least_px or not any(
        other.height_px() >= least_px and (other.confirmed or other.ready(tuning))
        for other in everybody
    )
