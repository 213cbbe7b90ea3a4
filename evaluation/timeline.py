"""Who was tracked as whom, when: the table behind the track timeline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.evaluation.alignment import AlignedSequence, best_pairs, check_iou_threshold

ABSENT = -2
"""The person is not in the ground truth of this frame."""

MISSED = -1
"""The person is there and no output box is paired with them."""


@dataclass(frozen=True, slots=True)
class Timeline:
    """One row per person of the ground truth, one column per frame.

    Attributes:
        tracks: ``(P, frame_count)`` int64: index into ``AlignedSequence.track_identities``, or
            ``MISSED`` or ``ABSENT``. Column ``i`` is frame ``i + 1``.
        switches: ``(P, frame_count)`` bool: the person's identity differs from the one they had
            when last paired. The number of switches is IDsw.
    """

    tracks: NDArray[np.int64]
    switches: NDArray[np.bool_]


def timeline(sequence: AlignedSequence, iou_threshold: float = 0.5) -> Timeline:
    """Pairs people and outputs as CLEAR MOT does: the pair of the frame before first, then IoU.

    The rule is that of TrackEval's ``CLEAR``, so that the switches shown are the ones counted.

    Raises:
        HeelError: the threshold is outside (0, 1].
    """
    check_iou_threshold(iou_threshold)
    people = len(sequence.gt_identities)
    tracks = np.full((people, sequence.frame_count), ABSENT, dtype=np.int64)
    switches = np.zeros(tracks.shape, dtype=np.bool_)
    before = np.full(people, MISSED)
    last = np.full(people, MISSED)
    for frame in sequence.frames:
        column = frame.frame - 1
        tracks[frame.gt, column] = MISSED
        if len(frame.gt) == 0 or len(frame.tracks) == 0:
            continue  # TrackEval keeps the pairs of the frame before across such frames
        preferred = before[frame.gt][:, None] == frame.tracks[None, :]
        rows, columns = best_pairs(frame.iou, iou_threshold, preferred)
        person, track = frame.gt[rows], frame.tracks[columns]
        tracks[person, column] = track
        switches[person, column] = (last[person] != MISSED) & (last[person] != track)
        last[person] = track
        before[:] = MISSED
        before[person] = track
    return Timeline(tracks, switches)
