"""Scores of any detector brought to one scale, learned online from the boxes themselves.

What a score means differs between detectors: the boxes of people who are followed for a while have
a median score of 0.98 from Faster R-CNN, 0.76 from a detector trained elsewhere, 55 from ACF. So
scores are divided by the running median of the scores of boxes that continue a track. Boxes that
stand alone say little: they are mostly false alarms.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from services.tracker.given_boxes.geometry import FloatArray

_REMEMBERED = 500  # boxes; some seconds of a crowd, a minute of one person


class ScoreScale:
    """Running median of the scores of boxes that continue a track."""

    def __init__(self) -> None:
        self._seen: deque[float] = deque(maxlen=_REMEMBERED)
        self._continued: deque[float] = deque(maxlen=_REMEMBERED)

    def normalised(self, scores: FloatArray) -> FloatArray:
        """Scores (N,) as shares in [0, 1] of a usual person's score so far, this frame included.

        Until a box has continued a track, all boxes seen stand in.
        """
        if not self._continued:
            self._seen.extend(scores.tolist())
        usual = self._continued or self._seen
        median = float(np.median(usual)) if usual else 1.0
        if median <= 0:
            return np.ones_like(scores)
        return np.asarray(np.clip(scores / median, 0.0, 1.0))

    def learn(self, scores: FloatArray) -> None:
        """Take raw scores (N,) of boxes that continued a track."""
        self._continued.extend(scores.tolist())
