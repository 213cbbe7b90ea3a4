"""Episodes with people that are not upright adults: postures, children, a wheelchair, a table."""

from __future__ import annotations

import math
from collections.abc import Callable

from heel.services.simulator.postures import Posture
from heel.services.simulator.script import Scenario
from heel.services.simulator.stage import Place, Stage
from heel.services.simulator.walks import Leg, Walk

_TABLE = (0.7, 1.6, 0.75)
"""Depth, width and height in metres of a table for four."""
_BEHIND_M = 0.97
"""From the middle of a table to a person sitting at it; people keep off what they do not touch."""


def _posture(posture: Posture) -> Callable[[Stage, str], Scenario]:
    def make(stage: Stage, name: str) -> Scenario:
        """Walks, stays for some seconds in the posture with the robot behind, twice."""
        speed = stage.uniform(0.8, 1.25)
        legs: list[Leg] = []
        x_m, y_m = 0.0, 0.0
        for _ in range(2):
            x_m, y_m = x_m + stage.uniform(3.0, 6.0), y_m + stage.uniform(-1.0, 1.0)
            legs.append(Leg(x_m, y_m, pause_s=stage.uniform(4.0, 7.0), posture=posture))
        legs.append(Leg(x_m + stage.uniform(2.0, 4.0), y_m))
        _target(stage, Walk(speed, tuple(legs), start_s=stage.uniform(2.0, 3.5)))
        if stage.rng.random() < 0.5:
            # Another person in that posture, beside the way.
            side = 1.0 if stage.rng.random() < 0.5 else -1.0
            at_x, at_y = legs[0].x_m * stage.uniform(0.3, 0.8), side * stage.uniform(0.9, 1.6)
            stay = Leg(at_x, at_y, pause_s=60.0, posture=posture)
            stage.add("other", at_x, at_y, stage.uniform(-math.pi, math.pi), Walk(1.0, (stay,)))
        return stage.finish(name, *stage.surround())

    return make


def child(stage: Stage, name: str) -> Scenario:
    """0.9 to 1.3 m tall; walks, stands, runs a little."""
    speed = stage.uniform(0.6, 1.3)
    legs = _ways(stage, speed, 3)
    height_m, radius_m = stage.uniform(0.9, 1.3), stage.uniform(0.14, 0.18)
    _target(stage, Walk(speed, legs, start_s=stage.uniform(2.0, 3.5)), height_m, radius_m)
    return stage.finish(name, *stage.surround())


def _wheelchair(stage: Stage, name: str) -> Scenario:
    speed = stage.uniform(0.6, 1.2)
    legs = _ways(stage, speed, 3)
    walk = Walk(speed, legs, start_s=stage.uniform(2.0, 3.5), posture="in a wheelchair")
    _target(stage, walk, radius_m=stage.uniform(0.33, 0.38))
    return stage.finish(name, *stage.surround())


def _table(stage: Stage, name: str) -> Scenario:
    """Sits behind a table, from the start or after a walk round it: only the upper body shows."""
    speed = stage.uniform(0.7, 1.1)
    if stage.rng.random() < 0.5:
        stage.put("furniture", (-_BEHIND_M, 0.0), _TABLE)
        legs = _ways(stage, speed, 2)
        _target(stage, Walk(speed, legs, start_s=stage.uniform(8.0, 12.0), at_first="seated"))
        return stage.finish(name, *stage.surround())
    at_m = stage.uniform(4.0, 7.0)
    stage.put("furniture", (at_m, 0.0), _TABLE)
    seat: Place = (at_m + _BEHIND_M, 0.0)
    legs = (
        Leg(at_m - 1.6, 0.3),
        Leg(at_m - 0.2, 1.5),
        Leg(seat[0] + 0.2, 1.3),
        Leg(*seat, pause_s=stage.uniform(6.0, 10.0), posture="seated"),
        Leg(seat[0] + stage.uniform(3.0, 5.0), 0.0),
    )
    _target(stage, Walk(speed, legs, start_s=stage.uniform(2.0, 3.5)))
    return stage.finish(name, *stage.surround())


POSTURES: dict[str, Callable[[Stage, str], Scenario]] = {
    "posture-bend": _posture("bent"),
    "posture-tie": _posture("tying shoes"),
    "posture-crouch": _posture("crouching"),
    "posture-chair": _posture("seated"),
    "posture-ground": _posture("on the ground"),
    "posture-fall": _posture("lying"),
    "child": child,
    "wheelchair": _wheelchair,
    "table": _table,
}


def _ways(stage: Stage, speed_mps: float, stops: int) -> tuple[Leg, ...]:
    """Straight on with some turns, standing at each for a while."""
    legs, x_m, y_m = [], 0.0, 0.0
    for _ in range(stops):
        x_m, y_m = x_m + speed_mps * stage.uniform(4.0, 7.0), y_m + stage.uniform(-1.2, 1.2)
        legs.append(Leg(x_m, y_m, pause_s=stage.uniform(1.0, 5.0)))
    return tuple(legs)


def _target(
    stage: Stage, walk: Walk, height_m: float | None = None, radius_m: float | None = None
) -> None:
    stage.add("target", 0.0, 0.0, stage.uniform(-0.3, 0.3), walk, height_m, radius_m)
