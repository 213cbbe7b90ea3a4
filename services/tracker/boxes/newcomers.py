"""New tracks: of boxes that are associated with no track, and those of people near enough."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heel.services.geometry.boxes import iou_matrix
from heel.services.tracker.boxes.frame import FrameBoxes
from heel.services.tracker.people import kalman
from heel.services.tracker.people.track import Track
from heel.services.tracker.people.tuning import Tuning

_DUPLICATE_IOU = 0.5
"""IoU with a track that has a box above which no track is born, as detectors may give two boxes of
one person; chosen by hand."""
_CONFIRM_HITS = 3
"""Boxes before a track is shown: a false alarm seldom comes three times at one place; chosen by
hand."""
_CONFIRM_EXISTENCE = 0.95
"""Probability of being a person from which a track is shown; chosen by hand."""
WALKER_SCORE = 0.6
"""Mean score from which a track is shown that has walked before a standing camera [share of a usual
person's]; chosen by hand."""


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


def ready_tracks(tracks: Sequence[Track], least_px: float, tuning: Tuning) -> list[Track]:
    """New tracks with evidence enough to be people.

    Args:
        tracks: all. tuning: least scores.
        least_px: height below which none is new while a taller one is in sight.
    """
    sure = [track for track in tracks if not track.confirmed and _is_sure(track, tuning)]
    known = [track for track in tracks if track.confirmed]
    tall = any(track.height_px() >= least_px for track in (*known, *sure))
    return [track for track in sure if not tall or track.height_px() >= least_px]


def _is_sure(track: Track, tuning: Tuning) -> bool:
    least = WALKER_SCORE if track.walked else tuning.shown_score
    return (
        track.hits >= _CONFIRM_HITS
        and track.existence >= _CONFIRM_EXISTENCE
        and track.mean_score >= least
    )
