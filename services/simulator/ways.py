"""Ways of the person to follow, in the frame of the stage."""

from __future__ import annotations

import math

from heel.services.simulator.stage import Place, Stage
from heel.services.simulator.walks import Leg, Walk


def sign(stage: Stage) -> float:
    """1 or -1, as chance will have it."""
    return 1.0 if stage.rng.random() < 0.5 else -1.0


def send(
    stage: Stage, speed_mps: float, points: list[Place], pauses_s: dict[int, float] | None = None,
    carries: bool = False,
) -> None:  # fmt: skip
    """The target, on a way with pauses at points by their index; with or without a box."""
    pauses = pauses_s or {}
    legs = (Leg(*point, pause_s=pauses.get(index, 0.0)) for index, point in enumerate(points))
    start(stage, speed_mps, tuple(legs), carries)


def start(stage: Stage, speed_mps: float, legs: tuple[Leg, ...], carries: bool = False) -> None:
    """The target stands until the robot has had time to look."""
    walk = Walk(speed_mps, legs, start_s=stage.uniform(2.0, 3.5))
    stage.add("target", 0.0, 0.0, stage.uniform(-0.3, 0.3), walk, carries=carries)


def gentle(stage: Stage, length_m: float, origin: Place = (0.0, 0.0)) -> list[Place]:
    """Points of a way without sharp turns."""
    return wander(stage, length_m, (4.0, 7.0), (0.0, 0.6), 0.7, origin)


def wander(
    stage: Stage,
    length_m: float,
    leg_m: tuple[float, float],
    turn_rad: tuple[float, float],
    most_rad: float,
    origin: Place = (0.0, 0.0),
) -> list[Place]:
    """Points one after the other, turning by so much at each but never far off the x axis."""
    (x_m, y_m), heading = origin, 0.0
    points = []
    while length_m > 0:
        step = min(stage.uniform(*leg_m), max(length_m, leg_m[0]))
        x_m, y_m = x_m + step * math.cos(heading), y_m + step * math.sin(heading)
        points.append((x_m, y_m))
        length_m -= step
        turn = stage.uniform(*turn_rad) * sign(stage)
        heading += turn if abs(heading + turn) <= most_rad else -turn
    return points
