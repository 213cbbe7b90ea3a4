"""Motion of the camera, estimated from the boxes alone, where nobody tells it.

The innovations of the Kalman filters are independent while the camera stands: people do not change
pace together. A camera that turns or shakes causes equal innovations of all of them at once. So the
correlation of innovations between people of one frame shows a moving camera; people that walk
steadily side by side do not appear as one, since their filters predict that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heel.services.tracker.people.geometry import FloatArray
from heel.services.tracker.people.kalman import NOISE_X, NOISE_Y
from heel.services.tracker.people.track import Track

_MOST_CORRELATION = 0.07
"""Correlation of innovations up to which the camera is taken to stand; chosen by hand."""
_PRIOR_BOXES = 200.0
"""Weight of the prior that it stands [boxes]: some seconds of a group; chosen by hand."""
_MEMORY_FRAMES = 500.0
"""Memory of innovations [frames]: some twenty seconds; chosen by hand."""


class CameraMotion:
    """Running correlation of innovations, started from a camera that stands still."""

    def __init__(self) -> None:
        # Innovations below the usual scatter of boxes do not count: hand-made boxes are corrected
        # for all people in one frame, which is no motion of the camera.
        self._scatter = NOISE_X**2 + NOISE_Y**2
        self._common = 0.0
        self._total = 0.0
        self._weight = 0.0

    def learn(self, surprises: FloatArray) -> None:
        """Take one frame's innovations (N, 2), in heights, of people seen in the last frame, too.

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
        """Share in [0, 1] of the innovations that people have in common; 0 until it is known."""
        if self._weight == 0:
            return 0.0
        sure = self._weight / (self._weight + _PRIOR_BOXES)
        return min(max(sure * self._common / max(self._total, 1e-12), 0.0), 1.0)

    def stands(self) -> bool:
        """Whether places in the picture are places in the world."""
        return self.correlation() < _MOST_CORRELATION


def common_shift(surprises: FloatArray, variances: FloatArray) -> FloatArray:
    """The common part (2,) in pixels of one frame's innovations: the motion of the camera.

    Args:
        surprises: (N, 2) innovations of the boxes' centres in pixels, N > 0.
        variances: (N, 2) predicted, px^2; innovations beyond three sigmas are clipped to that.
    """
    most = 3 * np.sqrt(variances)
    return np.asarray(
        (np.clip(surprises, -most, most) / variances).sum(axis=0) / (1 / variances).sum(axis=0)
    )


def shift_unseen(
    unseen: Sequence[Track], surprises: FloatArray, covariance: FloatArray, variance: FloatArray
) -> None:
    """Shift tracks without a box by the motion of the camera that the others show; in place.

    Args:
        unseen: tracks to shift.
        surprises: (N, 2) innovations in pixels of the tracks with a box, N > 0.
        covariance: (N, 4, 2, 2) predicted, and variance: (N, 4) of boxes, of the same tracks; see
            `kalman`.
    """
    total = covariance[:, :2, 0, 0] + variance[:, :2]
    shift = common_shift(surprises, total)
    speed = (covariance[:, :2, 0, 1] / total).mean(axis=0) * shift
    for track in unseen:
        track.mean[:2, 0] += shift
        track.mean[:2, 1] += speed
