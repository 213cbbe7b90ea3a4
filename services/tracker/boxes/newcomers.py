"""New tracks: of boxes that are associated with no track, and those of people near enough."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heel.services.geometry.boxes import iou_matrix
from heel.services.tracker.boxes.frame import FrameBoxes
from heel.services.tracker.boxes.tuning import Tuning
from heel.services.tracker.people import kalman
from heel.services.tracker.people.track import Track

_DUPLICATE_IOU = 0.5
"""IoU with a track that has a box above which no track is born, as detectors may give two boxes of
one person; chosen by hand."""


def newborn(
    frame: FrameBoxes, free: Sequence[int], known: Sequence[Track], t_s: float,
    tuning: Tuning,
) -> list[Track]:  # fmt: skip
    """A track for each box that is associated with none, highest score first.

    Args:
        frame: the boxes.
        free: indices of the boxes that are associated with no track.
        known: all tracks so far; none is born on a track that has a box in this frame.
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
    """Whether a new track is tall enough, or no other track that is so is in sight."""
    return track.height_px() >= least_px or not any(
        other.height_px() >= least_px and (other.confirmed or other.ready(tuning))
        for other in everybody
    )
