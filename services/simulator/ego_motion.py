"""How the picture moves because the robot does, as an estimator from the pixels would say."""

from __future__ import annotations

import math

import numpy as np

from heel.schemas import CameraMotion
from heel.services.simulator.state import CameraMount, RobotState
from heel.services.simulator.views import lens, to_robot

_BACKGROUND_M = 5.0
"""Typical distance of what features are found on; what is nearer moves more than they say."""
_LEAST_PX = 0.05
"""A smaller shift of the picture between two frames is none: detectors cannot measure it either;
chosen by hand."""
_NOISE_PX = 0.2
"""Standard deviation of a measured shift of the picture, whatever its size; chosen by hand."""
_NOISE_SHARE = 0.01
"""And the share of the shift that comes on top; chosen by hand."""


class EgoMotion:
    """Affine motion of the picture between two frames, with noise."""

    def __init__(self, mount: CameraMount, rng: np.random.Generator) -> None:
        self._camera = lens(mount)
        self._rng = rng
        self._before: RobotState | None = None

    def since_last(self, robot: RobotState, quality: float) -> CameraMotion | None:
        """The motion since the last call, None when the camera has not moved.

        Args:
            robot: where it is now.
            quality: of the picture, 0 to 1.
        """
        before, self._before = self._before, robot
        noise = self._rng.standard_normal(7)
        if before is None:
            return None
        turn = math.remainder(robot.heading_rad - before.heading_rad, 2 * math.pi)
        ahead_m = float(to_robot(np.array([[robot.x_m, robot.y_m]]), before)[0, 0])
        camera = self._camera
        pan_px = camera.focal_px * math.tan(turn)
        zoom_px = camera.width_px / 2 * ahead_m / _BACKGROUND_M
        if abs(pan_px) < _LEAST_PX and abs(zoom_px) < _LEAST_PX:
            return None
        moved_px = abs(pan_px) + abs(zoom_px)
        zoom = 1.0 + ahead_m / (_BACKGROUND_M * math.exp(0.2 * float(noise[0])))
        spread_px = _NOISE_PX + _NOISE_SHARE * moved_px
        tilt = spread_px / camera.width_px * noise[1:5]
        shift = spread_px * noise[5:7]
        centre = np.array([camera.centre_x_px, camera.horizon_px])
        linear = np.array([[zoom, 0.0], [0.0, zoom]]) + tilt.reshape(2, 2)
        offset = centre - linear @ centre + (pan_px, 0.0) + shift
        agree = (0.92 - 0.3 * min(moved_px / 100.0, 1.0)) * quality + 0.03 * float(noise[0])
        (a, b), (c, d) = linear.tolist()
        tx, ty = offset.tolist()
        return CameraMotion(affine=(a, b, tx, c, d, ty), quality=min(max(agree, 0.0), 1.0))
