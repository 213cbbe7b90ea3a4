"""Merged boxes: one detector box drawn around two people that overlap.

The paper detects a merge when the number of blobs falls and a larger blob appears. Here a merge is
a hypothesis beside the others: the box is the union of the predicted boxes of two people. If it
wins, both are measured by its edges, see `people.merged`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.services.geometry.boxes import areas, intersection_matrix
from heel.services.tracker.people.association import (
    GATE,
    REFUSED,
    assign,
    in_heights,
    log_student,
)
from heel.services.tracker.people.geometry import (
    FloatArray,
    boxes_to_measurements,
)
from heel.services.tracker.people.kalman import NOISE_ASPECT, NOISE_HEIGHT, NOISE_X, NOISE_Y

_OVERLAP = 0.2
"""Predicted overlap, share of the smaller box, from which two people may share one box;
chosen by hand."""
_RATE = 0.05
"""Probability that two people that fully overlap get one box; chosen by hand."""
_NOISE = 1.5
"""Standard deviation of merged boxes [that of single boxes]; chosen by hand."""
_GROWTH = 0.2
"""Least excess of the merged box's area over that of either member; chosen by hand."""
LONGEST_S = 1.0
"""Longest time without a box of its own for which a track may be in a merged one [s]; chosen by
hand."""


@dataclass(frozen=True)
class Sharing:
    """Two tracks that share one box, and the log odds of that against leaving all unpaired."""

    tracks: tuple[int, int]
    box: int
    log_odds: float


def merge_candidates(
    members: list[int],
    predicted: FloatArray,
    boxes: FloatArray,
    rates: FloatArray,
    newcomer: FloatArray,
) -> list[Sharing]:
    """All merges that are within the gate and better than leaving all unpaired.

    Args:
        members: indices of the tracks that may merge.
        predicted: (N, 4) predicted xyxy boxes of all tracks.
        boxes: (M, 4) detector's boxes.
        rates: (N,) chance of each track to be seen.
        newcomer: (M,) log density of a newcomer's box.
    """
    if len(members) < 2 or len(boxes) == 0:
        return []
    first, second, shared, union = _overlapping(predicted[members])
    if len(first) == 0:
        return []
    density, distance = _fit(union, boxes)
    odds = np.log(rates[members] / (1 - rates[members]))
    merged = np.log(np.minimum(_RATE * shared, 0.95))
    total = density - newcomer[None] + (odds[first] + odds[second] + merged)[:, None]
    good = (distance < GATE) & (total > 0)
    return [
        Sharing((members[first[p]], members[second[p]]), int(j), float(total[p, j]))
        for p, j in zip(*np.nonzero(good), strict=True)
    ]


def _overlapping(
    predicted: FloatArray,
) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray, FloatArray]:
    """Pairs of (N, 4) boxes that may merge: indices (P,) twice, overlap (P,), union (P, 4)."""
    area = areas(predicted)
    overlap = intersection_matrix(predicted, predicted) / np.minimum(area[:, None], area[None])
    first, second = np.nonzero(np.triu(overlap > _OVERLAP, 1))
    union = np.concatenate(
        [
            np.minimum(predicted[first, :2], predicted[second, :2]),
            np.maximum(predicted[first, 2:], predicted[second, 2:]),
        ],
        axis=1,
    )
    large = areas(union) > (1 + _GROWTH) * np.maximum(area[first], area[second])
    first, second = first[large], second[large]
    return first, second, overlap[first, second], union[large]


def _fit(
    union: FloatArray,
    boxes: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Log density (P, M) of (M, 4) boxes about (P, 4) unions, and distance in sigmas."""
    value, seen = boxes_to_measurements(union), boxes_to_measurements(boxes)
    scale = in_heights(np.exp(value[:, 2]))
    spread = np.array([NOISE_X, NOISE_Y, NOISE_HEIGHT, NOISE_ASPECT])
    variance = np.broadcast_to((_NOISE * spread) ** 2, scale.shape)
    return log_student((seen[None] - value[:, None]) / scale[:, None], variance[:, None])


def choose_merges(
    log_odds: FloatArray, candidates: list[Sharing]
) -> tuple[list[tuple[int, int]], list[Sharing], FloatArray]:
    """Kuhn-Munkres, then every merge that is worth more than what its members got, best first.

    Args:
        log_odds: (N, M) of single pairs. candidates: merges over the same rows and columns.

    Returns:
        The pairs (track, box), the merges, and the log odds with merged rows and columns refused.
    """
    pairs = assign(log_odds)
    merges: list[Sharing] = []
    for merge in sorted(candidates, key=lambda candidate: -candidate.log_odds):
        taken = {i for done in merges for i in done.tracks}
        if taken & set(merge.tracks) or any(done.box == merge.box for done in merges):
            continue
        trial = log_odds.copy()
        trial[list(merge.tracks)] = REFUSED
        trial[:, merge.box] = REFUSED
        rest = assign(trial)
        worth = merge.log_odds + sum(float(trial[i, j]) for i, j in rest)
        if worth > sum(float(log_odds[i, j]) for i, j in pairs):
            pairs, log_odds = rest, trial
            merges.append(merge)
    return pairs, merges, log_odds
