"""What a detector takes for people and is none: furniture, shadows, reflections; never for long."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.services.geometry.camera import GroundCamera
from heel.services.simulator.state import Colour, Obstacle, RobotState
from heel.services.simulator.views import to_robot

Array = NDArray[np.float64]
_NEAR_M = 1.5
"""Nearest place of a box on nothing; chosen by hand: nearer, it would fill the picture."""
_FAR_M = 9.0
"""Farthest place of one; chosen by hand: about the far wall of a room."""
_MOST = 4
"""At a time, however high the rate is set; chosen by hand."""


@dataclass(frozen=True, slots=True)
class _Alarm:
    x_m: float
    y_m: float
    height_m: float
    width_m: float
    score: float
    colour: Colour
    until_s: float


class FalseAlarms:
    """Keeps those of the moment; each stays at one place of the world for a short life.

    Args:
        obstacles: of the world; every other alarm is one of its pieces of furniture.
        rate_hz: how many begin a second.
        life_s: how long they last, on average.
        rng: chance.
    """

    def __init__(
        self, obstacles: tuple[Obstacle, ...], rate_hz: float, life_s: float,
        rng: np.random.Generator,
    ) -> None:  # fmt: skip
        self._furniture = [o for o in obstacles if o.kind == "furniture"]
        self._rate_hz = rate_hz
        self._life_s = life_s
        self._rng = rng
        self._alarms: list[_Alarm] = []

    def step(self, t_s: float, dt_s: float, robot: RobotState) -> None:
        """Let old ones end and new ones begin."""
        self._alarms = [alarm for alarm in self._alarms if alarm.until_s > t_s]
        if self._rng.random() < self._rate_hz * dt_s and len(self._alarms) < _MOST:
            self._alarms.append(self._begin(t_s, robot))

    def boxes(self, robot: RobotState, camera: GroundCamera) -> tuple[Array, Array, Array]:
        """Boxes (K, 4) in pixels, not clipped, scores (K,) and colours (K, 3) RGB."""
        alarms = self._alarms
        if not alarms:
            return np.zeros((0, 4)), np.zeros(0), np.zeros((0, 3))
        place = to_robot(np.array([(a.x_m, a.y_m) for a in alarms]), robot)
        ahead = place[:, 0] > _NEAR_M / 2
        seen = [alarm for alarm, is_ahead in zip(alarms, ahead.tolist(), strict=True) if is_ahead]
        boxes = camera.person_boxes(
            place[ahead], np.array([a.height_m for a in seen]), np.array([a.width_m for a in seen])
        )
        boxes = boxes + self._rng.normal(0.0, 2.0, (len(seen), 4))
        scores = np.array([a.score for a in seen])
        return boxes, scores, np.array([a.colour for a in seen], float).reshape(-1, 3)

    def _begin(self, t_s: float, robot: RobotState) -> _Alarm:
        rng = self._rng
        height_m = float(rng.uniform(0.9, 1.8))
        pieces = [o for o in self._furniture if self._is_ahead(o, robot)]
        if pieces and rng.random() < 0.5:
            piece = pieces[int(rng.integers(len(pieces)))]
            x_m, y_m, colour = piece.x_m, piece.y_m, piece.colour
        else:
            bearing = robot.heading_rad + float(rng.uniform(-0.7, 0.7))
            away = float(rng.uniform(_NEAR_M, _FAR_M))
            x_m, y_m = robot.x_m + away * math.cos(bearing), robot.y_m + away * math.sin(bearing)
            red, green, blue = rng.integers(20, 220, 3).tolist()
            colour = (red, green, blue)
        return _Alarm(
            x_m=x_m,
            y_m=y_m,
            height_m=height_m,
            width_m=height_m * float(rng.uniform(0.25, 0.45)),
            score=float(rng.uniform(0.2, 0.65)),
            colour=colour,
            until_s=t_s + float(rng.exponential(self._life_s)),
        )

    @staticmethod
    def _is_ahead(piece: Obstacle, robot: RobotState) -> bool:
        offset_x, offset_y = piece.x_m - robot.x_m, piece.y_m - robot.y_m
        away = math.hypot(offset_x, offset_y)
        side = math.remainder(math.atan2(offset_y, offset_x) - robot.heading_rad, 2 * math.pi)
        return _NEAR_M < away < _FAR_M and abs(side) < 0.7
