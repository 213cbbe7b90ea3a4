"""A person's place and velocity on the ground, filtered over frames."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
_WALK_MPS = 1.0
"""Standard deviation of a first velocity, m/s: people walk."""
_ACCELERATION_MPS2 = 2.5
"""People start and stop at about that."""
_LONGEST_S = 1.0
"""Seconds that a place is predicted ahead at most; chosen by hand."""
_GATE = 25.0
"""Squared standard deviations from which a measurement starts the filter anew: five of them."""
_FASTEST_MPS = 2.5
"""Metres per second that a person to follow walks at most: a jog. Chosen by hand."""
_OBSERVED = np.eye(2, 4)
"""The place is measured, the velocity is not."""


class PlaceFilter:
    """Kalman filter of constant velocity in the plane.

    A measurement five standard deviations off starts it anew: to believe that a person is suddenly
    near is safer than to smooth it over.
    """

    def __init__(self, place: FloatArray, covariance: FloatArray, t_s: float) -> None:
        self._start(place, covariance)
        self.t_s = t_s

    def _start(self, place: FloatArray, covariance: FloatArray) -> None:
        self._state = np.array([place[0], place[1], 0.0, 0.0])
        self._covariance = np.zeros((4, 4))
        self._covariance[:2, :2] = covariance
        self._covariance[2:, 2:] = np.eye(2) * _WALK_MPS**2

    @property
    def velocity(self) -> tuple[float, float]:
        """Metres per second, no faster than people that can be followed."""
        vx, vy = float(self._state[2]), float(self._state[3])
        scale = min(1.0, _FASTEST_MPS / max(math.hypot(vx, vy), 1e-9))
        return scale * vx, scale * vy

    def update(self, place: FloatArray, covariance: FloatArray, t_s: float) -> None:
        """Take a measurement of the place: (2,) metres with its (2, 2) covariance."""
        self._predict(t_s)
        innovation = place - self._state[:2]
        expected = self._covariance[:2, :2] + covariance
        gain = np.linalg.solve(expected, self._covariance[:2, :]).T
        if float(innovation @ np.linalg.solve(expected, innovation)) > _GATE:
            self._start(place, covariance)
            return
        self._state = self._state + gain @ innovation
        kept = np.eye(4) - gain @ _OBSERVED
        self._covariance = kept @ self._covariance @ kept.T + gain @ covariance @ gain.T

    def place_at(self, t_s: float) -> tuple[float, float]:
        """Where the person is expected; people are not expected to walk on unseen for long."""
        dt_s = min(max(0.0, t_s - self.t_s), _LONGEST_S)
        vx, vy = self.velocity
        return float(self._state[0]) + vx * dt_s, float(self._state[1]) + vy * dt_s

    def _predict(self, t_s: float) -> None:
        dt_s = min(max(0.0, t_s - self.t_s), _LONGEST_S)
        self.t_s = max(t_s, self.t_s)
        step = np.eye(4)
        step[0, 2] = step[1, 3] = dt_s
        by_acceleration = np.array([[dt_s**2 / 2, 0.0], [0.0, dt_s**2 / 2], [dt_s, 0.0],
                                    [0.0, dt_s]])  # fmt: skip
        noise = by_acceleration @ by_acceleration.T * _ACCELERATION_MPS2**2
        self._state = step @ self._state
        self._covariance = step @ self._covariance @ step.T + noise


def polar_covariance(
    angle_rad: float, distance_m: float, distance_sigma_m: float, bearing_sigma_rad: float
) -> FloatArray:
    """(2, 2) covariance in the plane of something seen at an angle and a distance."""
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    along = np.array([cosine, sine])
    across = np.array([-sine, cosine])
    across_m = max(1e-3, distance_m * bearing_sigma_rad)
    along_m = max(1e-3, distance_sigma_m)
    return np.outer(along, along) * along_m**2 + np.outer(across, across) * across_m**2
