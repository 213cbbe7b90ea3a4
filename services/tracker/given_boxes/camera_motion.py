"""Does the camera move, and how? Told by the boxes alone.

A Kalman filter's surprises are each person's own while the camera stands: people do not change pace
together. A camera that turns or shakes surprises all of them at once and alike. So the correlation
of surprises between people of one frame tells a moving camera; people who walk steadily side by
side do not look like one, since the filters expect what they do.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heel.services.tracker.given_boxes.geometry import FloatArray
from heel.services.tracker.given_boxes.kalman import NOISE_X, NOISE_Y
from heel.services.tracker.given_boxes.track import Track

_MOST_CORRELATION = 0.07
"""Correlation of innovations up to which the camera is taken to stand; chosen by hand."""
_PRIOR_BOXES = 200.0
"""Weight of the prior that it stands [boxes]: some seconds of a group."""
_MEMORY_FRAMES = 500.0
"""Memory of innovations [frames]: some twenty seconds."""


class CameraMotion:
    """Running correlation of surprises, started from a camera that stands still."""

    def __init__(self) -> None:
        # Surprises below the usual scatter of boxes say nothing: hand-made boxes are corrected in
        # one frame for everybody, which is no motion of the camera.
        self._scatter = NOISE_X**2 + NOISE_Y**2
        self._common = 0.0
        self._total = 0.0
        self._weight = 0.0

    def learn(self, surprises: FloatArray) -> None:
        """Take one frame's innovations (N, 2) of people seen in the last frame, too, in heights.

        Under equal correlation c, E[(sum e)^2 - sum e^2] = (n - 1) c E[sum e^2].
        """
        count = len(surprises)
        if count < 2:
            return
        own = float((surprises**2).sum())
        common = (float((surprises.sum(axis=0) ** 2).sum()) - own) / (count - 1)
        keep = 1 - 1 / _MEMORY_FRAMES
        self._common = keep * self._common + common
        self._total = keep * self._total + max(own, count * self._scatter)
        self._weight = keep * self._weight + count

    def correlation(self) -> float:
        """Share in [0, 1] of the surprises that people have in common; 0 until it is known."""
        if self._weight == 0:
            return 0.0
        sure = self._weight / (self._weight + _PRIOR_BOXES)
        return min(max(sure * self._common / max(self._total, 1e-12), 0.0), 1.0)

    def stands(self) -> bool:
        """Whether places in the picture are places in the world."""
        return self.correlation() < _MOST_CORRELATION


def common_shift(surprises: FloatArray, variances: FloatArray) -> FloatArray:
    """The motion (2,) in pixels that people in one frame did not make themselves: the camera's.

    Args:
        surprises: (N, 2) pixels by which boxes missed their predictions, N > 0.
        variances: (N, 2) that were expected of them; what is beyond three sigmas is cut to that.
    """
    most = 3 * np.sqrt(variances)
    return np.asarray(
        (np.clip(surprises, -most, most) / variances).sum(axis=0) / (1 / variances).sum(axis=0)
    )


def shift_unseen(
    unseen: Sequence[Track], surprises: FloatArray, covariance: FloatArray, variance: FloatArray
) -> None:
    """A camera that turns shifts those without a box as it shifts the others; in place.

    Args:
        unseen: who is to be shifted.
        surprises: (N, 2) pixels of those with a box, N > 0.
        covariance: (N, 4, 2, 2) predicted, and variance: (N, 4) of boxes, theirs; see `kalman`.
    """
    total = covariance[:, :2, 0, 0] + variance[:, :2]
    shift = common_shift(surprises, total)
    speed = (covariance[:, :2, 0, 1] / total).mean(axis=0) * shift
    for track in unseen:
        track.mean[:2, 0] += shift
        track.mean[:2, 1] += speed
