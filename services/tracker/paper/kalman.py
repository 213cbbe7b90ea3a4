"""The paper's motion model: state [Cx, Cy, A, s, dCx, dCy, dA, ds], constant velocity.

Cx, Cy: centre of the box, pixels. A: its area, square pixels. s: its span, here the width, pixels.
The other four are their rates per second. Height is A / s.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy, Point
from heel.services.geometry import boxes
from heel.services.tracker.paper.settings import BlobSettings

MIN_SIDE_PX = 1.0
"""Pixels: least width and height of a state, which keeps the height A / s defined."""
_FIRST_SPEED = 1.0
"""Heights per second: standard deviation of the unknown first velocity, a brisk walk."""


class BoxFilter:
    """A Kalman filter on one person's box (R. E. Kalman, 1960)."""

    def __init__(self, box: BoxXyxy, settings: BlobSettings) -> None:
        """Start at a measured box, at rest, with the velocity of a walker unknown."""
        self._settings = settings
        measured = _measurement(box)
        self._state = np.concatenate([measured, np.zeros(4)])
        deviations = np.concatenate([self._noise(), self._rates(_FIRST_SPEED, settings.growth)])
        self._covariance = np.diag(deviations**2)

    @property
    def box(self) -> BoxXyxy:
        """The box of the state, xyxy."""
        area, span = float(self._state[2]), float(self._state[3])
        return boxes.around((float(self._state[0]), float(self._state[1])), span, area / span)

    @property
    def area_px(self) -> float:
        """The paper's A."""
        return float(self._state[2])

    @property
    def span_px(self) -> float:
        """The paper's s."""
        return float(self._state[3])

    @property
    def velocity_pxps(self) -> Point:
        """Of the centre, pixels per second."""
        return float(self._state[4]), float(self._state[5])

    def predict(self, dt_s: float) -> None:
        """Move the state ahead by `dt_s` seconds (white acceleration, Bar-Shalom et al. 2001)."""
        transition = np.eye(8)
        transition[:4, 4:] = dt_s * np.eye(4)
        variances = self._rates(self._settings.acceleration, self._settings.growth) ** 2
        noise = np.zeros((8, 8))
        for axis, variance in enumerate(variances):
            noise[axis, axis] = variance * dt_s**4 / 4
            noise[axis, axis + 4] = noise[axis + 4, axis] = variance * dt_s**3 / 2
            noise[axis + 4, axis + 4] = variance * dt_s**2
        self._state = transition @ self._state
        self._covariance = transition @ self._covariance @ transition.T + noise
        self._keep_valid()

    def correct(self, box: BoxXyxy) -> None:
        """Take in a measured box, xyxy."""
        self._take_in(_measurement(box), self._noise())

    def coast(self, dt_s: float) -> None:
        """Nothing was measured: velocity fades, the size stays as it is."""
        self._state[4:6] *= np.exp(-self._settings.coasting_friction * dt_s)
        self._hold_size()

    def place(self, box: BoxXyxy) -> None:
        """Shift the centre to that of `box`, all else as it is."""
        self._state[:2] = boxes.centre(box)

    def _take_in(self, measured: NDArray[np.float64], deviations: NDArray[np.float64]) -> None:
        """Kalman correction by the first `len(measured)` components of the state."""
        count = len(measured)
        noise = np.diag(deviations**2)
        spread = self._covariance[:count, :count] + noise
        gain = np.linalg.solve(spread, self._covariance[:count]).T
        self._state = self._state + gain @ (measured - self._state[:count])
        # Joseph form: stays symmetric and positive whatever the rounding.
        keep = np.eye(8)
        keep[:, :count] -= gain
        self._covariance = keep @ self._covariance @ keep.T + gain @ noise @ gain.T
        self._keep_valid()

    def _hold_size(self) -> None:
        self._state[6:] = 0.0

    def _noise(self) -> NDArray[np.float64]:
        area, span = self._state[2], self._state[3]
        position = self._settings.position_noise * area / span
        size = self._settings.size_noise
        return np.array([position, position, size * area, size * span])

    def _rates(self, motion: float, growth: float) -> NDArray[np.float64]:
        area, span = self._state[2], self._state[3]
        height = area / span
        return np.array([motion * height, motion * height, growth * area, growth * span])

    def _keep_valid(self) -> None:
        span = max(self._state[3], MIN_SIDE_PX)
        self._state[3] = span
        self._state[2] = max(self._state[2], span * MIN_SIDE_PX)


def _measurement(box: BoxXyxy) -> NDArray[np.float64]:
    x, y = boxes.centre(box)
    span = max(boxes.width(box), MIN_SIDE_PX)
    return np.array([x, y, span * max(boxes.height(box), MIN_SIDE_PX), span])
