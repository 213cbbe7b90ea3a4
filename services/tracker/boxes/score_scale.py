"""Scores of any detector brought to one scale, learned online from the boxes themselves.

Scales of scores differ between detectors: boxes of people that are tracked for a while have a
median score of 0.98 from Faster R-CNN, 0.76 from a detector trained elsewhere, 55 from ACF. So
scores are divided by the running median of the scores of boxes that continue a track. Boxes that
continue none are left out: they are mostly false alarms.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections import deque

import numpy as np

from heel.services.tracker.people.geometry import FloatArray

_REMEMBERED = 500
"""Scores of the median [boxes]: some seconds of a crowd, or less than a minute of one person;
chosen by hand."""


class RunningMedian:
    """Median of the newest values, which are kept sorted: to sort them in each frame is slower."""

    def __init__(self) -> None:
        """Start without values."""
        self._newest: deque[float] = deque()
        self._sorted: list[float] = []

    def add(self, values: FloatArray) -> None:
        """Take more values (N,); of more than `_REMEMBERED` the oldest are dropped."""
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

        Until a box has continued a track, the median is that of all boxes.
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
