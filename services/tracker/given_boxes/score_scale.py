"""Scores of any detector brought to one scale, learned online from the boxes themselves.

What a score means differs between detectors: the boxes of people who are followed for a while have
a median score of 0.98 from Faster R-CNN, 0.76 from a detector trained elsewhere, 55 from ACF. So
scores are divided by the running median of the scores of boxes that continue a track. Boxes that
stand alone say little: they are mostly false alarms.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections import deque

import numpy as np

from heel.services.tracker.given_boxes.geometry import FloatArray

_REMEMBERED = 500  # boxes; some seconds of a crowd, a minute of one person


class RunningMedian:
    """Median of the newest values: kept sorted, since finding it anew took a tenth of a frame."""

    def __init__(self) -> None:
        """Start without values."""
        self._newest: deque[float] = deque()
        self._sorted: list[float] = []

    def add(self, values: FloatArray) -> None:
        """Take more values (N,); the oldest go once there are many."""
        for value in values.tolist():
            self._newest.append(value)
            insort(self._sorted, value)
            if len(self._newest) > _REMEMBERED:
                del self._sorted[bisect_left(self._sorted, self._newest.popleft())]

    def value(self) -> float | None:
        """The median, the mean of the middle two of an even number; None without values."""
        count = len(self._sorted)
        if count == 0:
            return None
        return (self._sorted[(count - 1) // 2] + self._sorted[count // 2]) / 2


class ScoreScale:
    """Running median of the scores of boxes that continue a track."""

    def __init__(self) -> None:
        """Start without scores."""
        self._seen = RunningMedian()
        self._continued = RunningMedian()

    def normalised(self, scores: FloatArray) -> FloatArray:
        """Scores (N,) as shares in [0, 1] of a usual person's score so far, this frame included.

        Until a box has continued a track, all boxes seen stand in.
        """
        median = self._continued.value()
        if median is None:
            self._seen.add(scores)
            median = self._seen.value()
        if median is None or median <= 0:
            return np.ones_like(scores)
        return np.asarray(np.clip(scores / median, 0.0, 1.0))

    def learn(self, scores: FloatArray) -> None:
        """Take raw scores (N,) of boxes that continued a track."""
        self._continued.add(scores)
