"""A camera that moves and says so: what is known of people is carried along with the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from services.tracker.given_boxes.geometry import FloatArray
from services.tracker.given_boxes.track import Track

_DRIFT = 0.1
"""Share of a shift that it may be wrong by even if all features agree: near things shift more."""


@dataclass(frozen=True)
class CameraStep:
    """How the picture moved since the frame before.

    Attributes:
        matrix: (2, 3) affine, from old pixels to new ones.
        quality: share in [0, 1] of features that agree with it.
    """

    matrix: FloatArray
    quality: float

    def places(self, points: FloatArray) -> FloatArray:
        """Where (N, 2) points of the frame before are now."""
        return np.asarray(points @ self.matrix[:, :2].T + self.matrix[:, 2])


def carry(tracks: Sequence[Track], step: CameraStep) -> None:
    """Move the state and the remembered places of tracks by a camera step, in place.

    Axes stay independent (see `kalman`): what a turn of the picture mixes between x and y goes into
    their variances, not between them.
    """
    if not tracks:
        return
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
    covariance[:, :2, 0, 0] += wrong**2
    anchors = step.places(np.stack([track.anchor[:2] for track in tracks]))
    births = step.places(np.stack([track.birthplace for track in tracks]))
    for k, track in enumerate(tracks):
        track.mean, track.covariance = mean[k], covariance[k]
        track.anchor = np.array([*anchors[k], track.anchor[2] + growth, track.anchor[3]])
        track.anchor_spread_px = float(np.hypot(track.anchor_spread_px, np.hypot(*wrong[k])))
        track.birthplace = births[k]
