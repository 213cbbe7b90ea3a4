"""What the robot itself measures: its wheels, and the free distance around it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Odometry, Ranges, RangeSector
from heel.services.simulator.robot import drive_arc, wrap
from heel.services.simulator.solids import Solids, cast_at_discs
from heel.services.simulator.state import RobotState

Array = NDArray[np.float64]


class WheelOdometry:
    """Counts the wheels' turns: a start at 0, small scale errors, and a drift that grows."""

    _SCALE = 0.01
    _NOISE = 0.03

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._scale = 1.0 + self._SCALE * rng.standard_normal(2)
        self._belief = RobotState(0.0, 0.0, 0.0, 0.0, 0.0)

    def step(self, dt_s: float, linear_mps: float, angular_radps: float) -> None:
        """Take in how the robot really moved."""
        factor = self._scale * (1.0 + self._NOISE * self._rng.standard_normal(2))
        self._belief = drive_arc(
            self._belief, linear_mps * float(factor[0]), angular_radps * float(factor[1]), dt_s
        )

    def message(self, seq: int) -> Odometry:
        """Where the robot believes it is."""
        belief = self._belief
        return Odometry(
            seq=seq,
            x_m=belief.x_m,
            y_m=belief.y_m,
            heading_rad=wrap(belief.heading_rad),
            linear_mps=belief.linear_mps,
            angular_radps=belief.angular_radps,
        )


class RangeRing:
    """Sectors all around that report their nearest obstacle or person, like a ring of sonars."""

    SECTORS = 36
    MAX_M = 6.0
    # A person is 4 degrees wide at the greatest range: rays 3.3 degrees apart miss none.
    _RAYS = 3

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        width = 2 * math.pi / self.SECTORS
        self._bearing = [wrap(width * index) for index in range(self.SECTORS)]
        within = (np.arange(self._RAYS) + 0.5) / self._RAYS - 0.5
        self._rays = (np.array(self._bearing)[:, None] + width * within).ravel()

    def message(
        self, seq: int, robot: RobotState, solids: Solids, centre: Array, radius_m: Array
    ) -> Ranges:
        """Look around once.

        Args:
            seq: number of the message.
            robot: where the ring is.
            solids: the obstacles.
            centre: people (N, 2) metres.
            radius_m: people's (N,).
        """
        angle = self._rays + robot.heading_rad
        rays = np.stack([np.cos(angle), np.sin(angle)], -1)
        origin = np.array([robot.x_m, robot.y_m])
        nearest = solids.cast(origin, rays)[0].min(1, initial=self.MAX_M)
        people = cast_at_discs(origin, rays, centre, radius_m).min(1, initial=self.MAX_M)
        true = np.minimum(nearest, people).reshape(self.SECTORS, -1).min(1)
        noise = (0.005 + 0.005 * true) * self._rng.standard_normal(self.SECTORS)
        seen = np.where(true < self.MAX_M, np.clip(true + noise, 0.0, self.MAX_M), self.MAX_M)
        width = 2 * math.pi / self.SECTORS
        sectors = tuple(
            RangeSector(bearing_rad=bearing, width_rad=width, distance_m=distance)
            for bearing, distance in zip(self._bearing, seen.tolist(), strict=True)
        )
        return Ranges(seq=seq, sectors=sectors)
