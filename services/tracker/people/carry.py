"""Warp of tracks by a known motion of the camera: states and remembered places move with the
picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heel.schemas import CameraMotion
from heel.services.geometry.picture_motion import moved_points
from heel.services.tracker.people.geometry import FloatArray
from heel.services.tracker.people.track import Track

_DRIFT = 0.1
"""Relative standard deviation of a shift even if all features agree, since near things shift more;
chosen by hand."""
_LATELY_S = 1.0
"""Time constant of the camera's recent step [s]; chosen by hand."""
_JERK = 2.0
"""Standard deviation of an unknown step of the camera [its recent steps]; chosen by hand."""


@dataclass(frozen=True)
class CameraStep:
    """Motion of the picture since the frame before.

    Attributes:
        matrix: (2, 3) affine, from old pixels to new ones.
        quality: share in [0, 1] of features that agree with it.
    """

    matrix: FloatArray
    quality: float

    @classmethod
    def told(cls, motion: CameraMotion) -> CameraStep:
        """As reported by a message."""
        return cls(np.array(motion.affine).reshape(2, 3), motion.quality)

    def places(self, points: FloatArray) -> FloatArray:
        """Places (N, 2) in this frame of (N, 2) points of the frame before, pixels."""
        return moved_points(self.matrix, points)


class Carrier:
    """Warps tracks by the motion of the camera, and remembers the size of its recent steps."""

    def __init__(self) -> None:
        """Start with a camera that has not moved."""
        self._lately_px = 0.0

    def carry(self, tracks: Sequence[Track], step: CameraStep, elapsed_s: float) -> None:
        """Move the state and the remembered places of tracks by a camera step, in place.

        A step of quality 0 is unknown: the variance of all places then grows by a step somewhat
        larger than the recent ones, since it is most often a jerk of the camera that hides it.

        Args:
            tracks: to warp. step: of the camera, since the frame before.
            elapsed_s: since the frame before.
        """
        self._lately_px *= math.exp(-elapsed_s / _LATELY_S)
        if not tracks:
            return
        places = np.stack([track.mean[:2, 0] for track in tracks])
        shift = np.hypot(*(step.places(places) - places).T)
        self._lately_px = max(self._lately_px, float(shift.mean()))
        unknown_px = _JERK * self._lately_px if step.quality <= 0.0 else 0.0
        _carry(tracks, step, unknown_px)


def _carry(tracks: Sequence[Track], step: CameraStep, unknown_px: float) -> None:
    """Warp, and add a standard deviation of `unknown_px` to the places.

    Axes stay independent (see `kalman`): a rotation of the picture, which mixes x and y, changes
    their variances and no covariance between them.
    """
    linear = step.matrix[:, :2]
    growth = 0.5 * float(np.log(max(abs(np.linalg.det(linear)), 1e-6)))
    mean = np.stack([track.mean for track in tracks])
    covariance = np.stack([track.covariance for track in tracks])
    before = mean[:, :2, 0].copy()
    mean[:, :2, 0] = step.places(before)
    mean[:, :2, 1] = mean[:, :2, 1] @ linear.T
    mean[:, 2, 0] += growth
    covariance[:, :2] = np.einsum("ab,nbij->naij", linear**2, covariance[:, :2])
    wrong = max(_DRIFT, 1 - step.quality) * (mean[:, :2, 0] - before)
    covariance[:, :2, 0, 0] += wrong**2 + unknown_px**2
    anchors = step.places(np.stack([track.anchor[:2] for track in tracks]))
    births = step.places(np.stack([track.birthplace for track in tracks]))
    for k, track in enumerate(tracks):
        track.mean, track.covariance = mean[k], covariance[k]
        track.anchor = np.array([*anchors[k], track.anchor[2] + growth, track.anchor[3]])
        track.anchor_spread_px = math.hypot(track.anchor_spread_px, *wrong[k].tolist(), unknown_px)
        track.birthplace = births[k]
