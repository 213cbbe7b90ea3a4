"""Constant-velocity Kalman filter of a foot point (R. E. Kalman, 1960)."""

from __future__ import annotations

import numpy as np

from heel.services.tracker.evidence.arrays import Floats, Foot

_POSITION = 0.05
"""Heights: standard deviation of the foot point at birth, about that of its measurement; chosen by
hand."""
_SPEED = 0.8
"""Heights per second: standard deviation of the speed across the image at birth, a brisk walk."""


class FootFilter:
    """State (x, y, vx, vy): working pixels and working pixels a second.

    Noise scales with the person's height, so that near and far people are treated alike.
    """

    def __init__(
        self, foot: Foot, height_px: float, acceleration: float, speed_y: float = 0.5
    ) -> None:
        """Start at rest.

        Args:
            foot: where.
            height_px: of the person.
            acceleration: standard deviation, heights/s^2.
            speed_y: deviation of the first speed along the image rows, heights/s; walking to or
                from the camera moves the feet less than walking across.
        """
        self.state: Floats = np.array([foot[0], foot[1], 0.0, 0.0])
        deviations = np.array([_POSITION, _POSITION, _SPEED, speed_y])
        self.covariance: Floats = np.diag((deviations * height_px) ** 2)
        self._acceleration = np.array([acceleration, acceleration * speed_y / 0.5])

    @property
    def foot(self) -> Foot:
        """Foot point."""
        return float(self.state[0]), float(self.state[1])

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity of the foot point."""
        return float(self.state[2]), float(self.state[3])

    def predict(self, dt_s: float, height_px: float, damping: float) -> None:
        """Move `dt_s` seconds on; `damping` multiplies the velocity."""
        move = np.eye(4)
        move[0, 2] = move[1, 3] = dt_s
        move[2, 2] = move[3, 3] = damping
        self.state = move @ self.state
        # Acceleration is white and constant over a step.
        push = np.array([[dt_s**2 / 2, 0], [0, dt_s**2 / 2], [dt_s, 0], [0, dt_s]])
        push = push * self._acceleration * height_px
        self.covariance = move @ self.covariance @ move.T + push @ push.T

    def carry(self, affine: Floats) -> None:
        """Warp the state by the camera's motion: (2, 3), old to new working pixels."""
        turn = np.kron(np.eye(2), affine[:, :2])
        self.state = turn @ self.state
        self.state[:2] += affine[:, 2]
        self.covariance = turn @ self.covariance @ turn.T

    def correct(self, foot: Foot, deviation_px: float) -> None:
        """Take a measured foot point in."""
        total = self.covariance[:2, :2] + np.eye(2) * deviation_px**2
        gain = self.covariance[:, :2] @ np.linalg.inv(total)
        self.state = self.state + gain @ (np.asarray(foot) - self.state[:2])
        self.covariance = self.covariance - gain @ self.covariance[:2]

    def move_to(self, foot: Foot, height_px: float) -> None:
        """Put the foot point there, keep the velocity, forget the position's uncertainty."""
        self.state[:2] = foot
        self.covariance[:2, :] = self.covariance[:, :2] = 0.0
        self.covariance[0, 0] = self.covariance[1, 1] = (_POSITION * height_px) ** 2
