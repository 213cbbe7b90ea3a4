"""One box around two people: each edge is that of the person whose predicted edge lies outermost.

With the person's known size that edge alone gives the person's place. So both are measured while
merged, and keep their identities at the split.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heel.services.tracker.people import kalman
from heel.services.tracker.people.geometry import FloatArray, measurements_to_boxes
from heel.services.tracker.people.track import Track

_SLACK = 0.05
"""Distance up to which edges are shared [heights]: about the standard deviation of an edge; chosen
by hand."""
_EDGE_NOISE = 2.0
"""Standard deviation of a centre measured by edges [that of single boxes]; chosen by hand."""


@dataclass(frozen=True)
class Merge:
    """Tracks measured by one box, (4,) xyxy pixels."""

    tracks: tuple[Track, Track]
    box: FloatArray


def measure_members(predicted: FloatArray, box: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places of the members of a merged box, by the edges that are theirs.

    An edge is shared by members whose predicted edges are closer than `_SLACK`.

    Args:
        predicted: (K, 4) predicted xyxy boxes of the members. box: (4,) the merged box.

    Returns:
        Centres (K, 2) in pixels and variance factors (K, 2): infinite where no edge is known.
    """
    count = len(predicted)
    centre, factor = np.zeros((count, 2)), np.full((count, 2), math.inf)
    size = predicted[:, 2:] - predicted[:, :2]
    for axis in (0, 1):
        low, high = predicted[:, axis], predicted[:, axis + 2]
        margin = _SLACK * float(size[:, 1].mean())
        owns_low = low <= np.min(low) + margin
        owns_high = high >= np.max(high) - margin
        by_low, by_high = box[axis] + size[:, axis] / 2, box[axis + 2] - size[:, axis] / 2
        owned = owns_low.astype(float) + owns_high
        value = (owns_low * by_low + owns_high * by_high) / np.maximum(owned, 1)
        alone = np.where(owns_low, owns_low.sum(), 0) + np.where(owns_high, owns_high.sum(), 0)
        centre[:, axis] = np.where(owned > 0, value, (low + high) / 2)
        factor[:, axis] = np.where(
            owned > 0, np.maximum(alone / np.maximum(owned, 1), 1.0), math.inf
        )
    return centre, factor


def correct_merged(merges: Sequence[Merge], t_s: float) -> None:
    """Correct the members of every merge by the edges that are theirs, in place; `t_s`: now."""
    for merge in merges:
        mean = np.stack([track.mean for track in merge.tracks])
        value = mean[:, :, 0].copy()
        variance = kalman.measurement_variance(value)
        centre, factor = measure_members(measurements_to_boxes(value), merge.box)
        value[:, :2] = centre
        variance[:, :2] *= np.minimum(factor, kalman.UNKNOWN) * _EDGE_NOISE**2
        variance[:, 2:] = kalman.UNKNOWN
        covariance = np.stack([track.covariance for track in merge.tracks])
        mean, covariance = kalman.update(mean, covariance, value, variance)
        for k, track in enumerate(merge.tracks):
            track.mean, track.covariance = mean[k], covariance[k]
            track.see(t_s)
