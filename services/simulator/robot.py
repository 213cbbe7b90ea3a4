"""The robot: a disc on two driven wheels that obeys late, gradually and not quite exactly."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from heel.services.simulator.state import RobotState


@dataclass(frozen=True, slots=True)
class RobotBody:
    """What the robot can do.

    Attributes:
        latency_s: from a command to the first reaction of the wheels.
        lag_s: time constant with which the wheels approach the command.
        slip: standard deviation of the real motion around that of the wheels, as a share of it.
    """

    radius_m: float = 0.25
    max_linear_mps: float = 1.6
    max_angular_radps: float = 3.0
    max_linear_mps2: float = 2.5
    max_angular_radps2: float = 8.0
    latency_s: float = 0.06
    lag_s: float = 0.12
    slip: float = 0.02


class Drivetrain:
    """From commands to motion."""

    def __init__(self, body: RobotBody, rng: np.random.Generator) -> None:
        self._body = body
        self._rng = rng
        self._on_the_way: deque[tuple[float, float, float]] = deque()
        self._command = (0.0, 0.0)
        self._now_s = 0.0

    def step(
        self, state: RobotState, dt_s: float, linear_mps: float, angular_radps: float
    ) -> RobotState:
        """The robot `dt_s` later, had it the floor to itself."""
        body = self._body
        self._on_the_way.append((self._now_s + body.latency_s, linear_mps, angular_radps))
        while self._on_the_way and self._on_the_way[0][0] <= self._now_s + 1e-9:
            self._command = self._on_the_way.popleft()[1:]
        self._now_s += dt_s
        share = -math.expm1(-dt_s / body.lag_s)
        linear = _approach(
            state.linear_mps,
            self._command[0],
            share,
            body.max_linear_mps,
            body.max_linear_mps2 * dt_s,
        )
        angular = _approach(
            state.angular_radps,
            self._command[1],
            share,
            body.max_angular_radps,
            body.max_angular_radps2 * dt_s,
        )
        slip = 1.0 + body.slip * self._rng.standard_normal(2)
        moved = drive_arc(state, linear * float(slip[0]), angular * float(slip[1]), dt_s)
        return replace(moved, linear_mps=linear, angular_radps=angular)


def drive_arc(
    state: RobotState, linear_mps: float, angular_radps: float, dt_s: float
) -> RobotState:
    """Differential drive with constant wheel speeds: an arc, in closed form."""
    turn = angular_radps * dt_s
    # sin(x)/x form of the chord, exact for arcs and for straight lines.
    half = turn / 2
    chord = linear_mps * dt_s * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
    return RobotState(
        x_m=state.x_m + chord * math.cos(state.heading_rad + half),
        y_m=state.y_m + chord * math.sin(state.heading_rad + half),
        heading_rad=wrap(state.heading_rad + turn),
        linear_mps=linear_mps,
        angular_radps=angular_radps,
    )


def wrap(angle_rad: float) -> float:
    """The same direction between -pi and pi."""
    return math.remainder(angle_rad, 2 * math.pi)


def _approach(now: float, wanted: float, share: float, limit: float, most: float) -> float:
    wanted = min(max(wanted, -limit), limit)
    return now + min(max((wanted - now) * share, -most), most)
