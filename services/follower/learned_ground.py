"""Where feet are seen by a camera of unstated mounting, learned from people that stand.

A person that bends down looks as if walking away, but the feet stay where they were. Of a box that
is seen whole, the height tells a distance, and the lower edge then tells one point of the camera's
`GroundLine`; from several it is estimated by a Kalman filter of its two numbers. A box whose
height does not fit the line is of a person that does not stand upright, and teaches nothing.
"""

from __future__ import annotations

import numpy as np

from heel.services.geometry.ground_line import GroundLine

_FALL_M = 0.8
"""Height of the camera before anything is learned, metres: robots carry it at 0.3 to 1.5 m."""
_FALL_SIGMA_M = 0.5
"""Standard deviation of that, metres; chosen by hand."""
_OFFSET_SIGMA = 0.2
"""Standard deviation of the horizon's place: a pitch of up to 20 degrees. Chosen by hand."""
_LEAST_FALL_M = 0.1
"""Metres: no camera that sees people's feet is lower."""
_HEIGHT_SHARE = 0.06
"""Heights of adults differ by that."""
_FORGET_S = 60.0
"""Seconds in which what was learned gets unsure again: a camera may be tilted. Chosen by hand."""
_ENOUGH = 5
"""Independent boxes from which the line is used; chosen by hand."""
_ALIKE_S = 1.0
"""Boxes of the same person are off by the same for about as long: they count once."""
_FRAME_S = 0.05
"""Seconds between two frames, where unknown, and the least that counts: 20 frames/s."""
_AGREE_SHARE = 0.12
"""Share of the fall by which a box may differ and still be of an upright person; chosen by hand."""


class LearnedGround:
    """Of one camera; a new one begins anew."""

    def __init__(self) -> None:
        self._prior = np.diag([_FALL_SIGMA_M**2, _OFFSET_SIGMA**2])
        self._state = np.array([_FALL_M, 0.0])
        self._covariance = self._prior.copy()
        self._frames = 0
        self._t_s: float | None = None

    @property
    def line(self) -> GroundLine | None:
        """What is known by now; None before a few boxes have taught it."""
        if self._frames < _ENOUGH:
            return None
        return GroundLine(max(float(self._state[0]), _LEAST_FALL_M), float(self._state[1]))

    def learn(self, slope: float, distance_m: float, noise: float, t_s: float) -> None:
        """Take in a box that is seen whole.

        Args:
            slope: of its lower edge.
            distance_m: of an upright adult with this box.
            noise: standard deviation of its height, as a share of it.
            t_s: when it was seen; of several in a picture the same.
        """
        since_s = _FRAME_S if self._t_s is None else max(t_s - self._t_s, 0.0)
        self._covariance = self._covariance + min(since_s / _FORGET_S, 1.0) * self._prior
        self._t_s = t_s
        row = np.array([1.0 / distance_m, 1.0])
        expected = float(row @ self._state)
        unsure = float(row @ self._covariance @ row)
        # What an adult's height and the box's edges are off by moves the point along the line.
        share = float(np.hypot(_HEIGHT_SHARE, noise))
        error = (share * max(float(self._state[0]), _LEAST_FALL_M) / distance_m) ** 2
        error *= _ALIKE_S / min(max(since_s, _FRAME_S), _ALIKE_S)
        agree = (_AGREE_SHARE + 2 * noise) * abs(float(self._state[0])) / distance_m
        if abs(slope - expected) > agree + 2 * unsure**0.5:
            return
        gain = self._covariance @ row / (unsure + error)
        self._state = self._state + gain * (slope - expected)
        kept = np.eye(2) - np.outer(gain, row)
        self._covariance = kept @ self._covariance @ kept.T + error * np.outer(gain, gain)
        self._frames += 1
