"""Episodes of everyday life: people out of view, met, hugged, seated, laden or pushed along."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from heel.services.simulator.posture_scenarios import child
from heel.services.simulator.robot import wrap
from heel.services.simulator.script import Scenario
from heel.services.simulator.stage import WALL_HEIGHT_M, WALL_M, Stage
from heel.services.simulator.walks import Leg, Pushing, Walk
from heel.services.simulator.ways import gentle, send, sign, start

_ARM_M = 0.46
"""Between two who hug, from middle to middle: their bodies touch."""
_BEHIND_CHAIR_M = 0.75
"""From the middle of a person in a wheelchair to the middle of the one who pushes; chosen by hand:
half a chair and two bent arms."""


def _enters(stage: Stage, name: str) -> Scenario:
    """Is out of view at first: aside of the robot or behind it, and walks off much later."""
    off_rad = stage.uniform(1.3, math.pi) * sign(stage)
    stage.robot = replace(stage.robot, heading_rad=wrap(stage.robot.heading_rad + off_rad))
    speed = stage.uniform(0.7, 1.1)
    legs = tuple(Leg(*point) for point in gentle(stage, speed * stage.uniform(20, 28)))
    walk = Walk(speed, legs, start_s=stage.uniform(12.0, 16.0))
    stage.add("target", 0.0, 0.0, stage.uniform(-math.pi, math.pi), walk)
    return stage.finish(name, *stage.surround())


def _hidden_twin(stage: Stage, name: str) -> Scenario:
    """Turns round the end of a wall, meets a twin behind it, and one after the other comes back.

    Either the twin comes out first, where the target went in, or after the target, the other way.
    """
    speed = stage.uniform(0.7, 1.0)
    length, depth = stage.uniform(4.0, 5.0), stage.uniform(0.5, 0.8)
    end_m, beside_m = stage.uniform(8.0, 11.0), stage.uniform(0.8, 0.95)
    behind = -beside_m - depth
    out = end_m + stage.uniform(2.6, 3.4), 0.0
    twin_first = stage.rng.random() < 0.5
    place = end_m - 0.25 * length, behind - 0.5
    legs = (
        Leg(end_m + 0.2, 0.0),
        Leg(end_m + 0.5, behind - 0.3),
        Leg(*place, hidden_s=7.0 if twin_first else 2.5),
        Leg(end_m + 0.5, behind - 0.2),
        Leg(end_m + 0.8, -0.1),
        Leg(*out),
        *(Leg(*point) for point in gentle(stage, speed * stage.uniform(14, 20), out)),
    )
    start(stage, speed, legs)
    arrival_s = stage.actors[0].walk.start_s + (end_m + 1.8) / speed
    if twin_first:
        # Past the target, round the same end, and off across the robot's view.
        away: tuple[Leg, ...] = (
            Leg(end_m + 0.4, behind - 1.1),
            Leg(end_m + 1.0, -0.4),
            Leg(end_m + stage.uniform(1.5, 3.0), stage.uniform(3.0, 4.0)),
        )
        twin_s = arrival_s + stage.uniform(1.0, 2.0)
    else:
        away = (Leg(end_m - length - 1.0, behind - 1.0), Leg(end_m - length - 4.0, behind - 2.0))
        twin_s = arrival_s + stage.uniform(4.0, 6.0)
    walk = Walk(stage.uniform(0.8, 1.0), away, start_s=twin_s)
    stage.add("twin", place[0] - 0.8, place[1], 0.0, walk)
    middle = end_m - length / 2, -beside_m - depth / 2
    stage.put("pillar", middle, (length, depth, WALL_HEIGHT_M))
    return stage.finish(name, *stage.surround())


def _hug(stage: Stage, name: str) -> Scenario:
    """Walks up to somebody who waits, hugs them for some seconds and walks on; so may they."""
    speed = stage.uniform(0.7, 1.1)
    at_m, angle = stage.uniform(5.0, 8.0), stage.uniform(-math.pi / 2, math.pi / 2)
    hugs_s = stage.uniform(3.0, 6.0)
    other = at_m + _ARM_M * math.cos(angle), _ARM_M * math.sin(angle)
    side = -math.copysign(1.0, other[1])
    on = at_m + 1.5, 1.2 * side
    legs = (
        Leg(at_m, 0.0, pause_s=hugs_s, close=True),
        Leg(*on),
        *(Leg(*point) for point in gentle(stage, speed * stage.uniform(14, 22), on)),
    )
    start(stage, speed, legs)
    leaves_s = stage.actors[0].walk.start_s + at_m / speed + hugs_s + stage.uniform(0.0, 1.0)
    away: tuple[Leg, ...] = ()
    if stage.rng.random() < 0.5:
        away = (Leg(other[0] - stage.uniform(0.0, 2.0), -4.0 * side),)
    walk = Walk(stage.uniform(0.8, 1.1), away, start_s=leaves_s)
    stage.add("other", *other, wrap(angle + math.pi), walk)
    return stage.finish(name, *stage.surround())


def _sits(stage: Stage, name: str) -> Scenario:
    """Sits down, is passed by somebody who crosses before them, stands up and walks on."""
    speed = stage.uniform(0.7, 1.1)
    at_m, sits_s = stage.uniform(5.0, 8.0), stage.uniform(8.0, 14.0)
    seat = at_m, stage.uniform(-0.3, 0.3)
    legs = (
        Leg(*seat, pause_s=sits_s, posture="seated"),
        *(Leg(*point) for point in gentle(stage, speed * stage.uniform(12, 18), seat)),
    )
    start(stage, speed, legs)
    seated_s = stage.actors[0].walk.start_s + at_m / speed
    side, before_m = sign(stage), at_m - stage.uniform(0.7, 0.85)
    passes = Walk(
        stage.uniform(0.9, 1.2), (Leg(before_m, -4.0 * side),),
        start_s=seated_s + stage.uniform(0.3, 0.6) * sits_s,
    )  # fmt: skip
    stage.add("other", before_m, 4.0 * side, -side * math.pi / 2, passes)
    return stage.finish(name, *stage.surround())


def _carries(stage: Stage, name: str) -> Scenario:
    """Walks along with a box before the chest, turns about, and comes back towards the robot."""
    speed = stage.uniform(0.6, 0.9)
    points = gentle(stage, speed * stage.uniform(12, 16))
    x_m, y_m = points[-1]
    side = 1.5 * sign(stage)
    back = [(x_m - 1.5, y_m + side), (x_m - 4.0, y_m + 1.6 * side)]
    send(stage, speed, [*points, *back], carries=True)
    return stage.finish(name, *stage.surround())


def _pushed(stage: Stage, name: str) -> Scenario:
    """Sits in a wheelchair that somebody pushes, who walks between them and the robot."""
    speed = stage.uniform(0.6, 0.9)
    legs, x_m, y_m = [], 0.0, 0.0
    for _ in range(3):
        x_m, y_m = x_m + speed * stage.uniform(6.0, 9.0), y_m + stage.uniform(-2.0, 2.0)
        legs.append(Leg(x_m, y_m, pause_s=stage.uniform(1.0, 4.0)))
    walk = Walk(speed, tuple(legs), start_s=stage.uniform(3.0, 4.0), posture="in a wheelchair")
    stage.add("target", 0.0, 0.0, stage.uniform(-0.3, 0.3), walk,
              radius_m=stage.uniform(0.33, 0.38))  # fmt: skip
    beside = -0.5, 0.9 * sign(stage)
    stage.add("other", *beside, 0.0, Walk(1.3 * speed, (Pushing(_BEHIND_CHAIR_M),)))
    return stage.finish(name, *stage.surround())


def _through_door(stage: Stage, name: str) -> Scenario:
    """Turns aside through a door and walks on in the room behind the wall: waiting is no use."""
    speed = stage.uniform(0.7, 1.0)
    door_m, half_door = stage.uniform(6.0, 9.0), stage.uniform(0.75, 0.9)
    wall_m, side = -stage.uniform(0.9, 1.1), sign(stage)
    inside = wall_m - WALL_M / 2 - 0.8
    turn = door_m + side * stage.uniform(2.5, 4.0), inside - stage.uniform(0.0, 0.8)
    end = turn[0] + side * stage.uniform(1.0, 3.0), turn[1] - stage.uniform(1.0, 2.0)
    legs = (Leg(door_m - 0.1, 0.0), Leg(door_m, inside), Leg(*turn), Leg(*end))
    start(stage, speed, legs)
    x0, _, x1, y1 = stage.extent(stage.uniform(2.0, 3.0))
    bounds = x0, end[1] - stage.uniform(1.5, 3.0), x1, y1
    stage.walls_around(bounds)
    stage.wall((x0, wall_m), (door_m - half_door - WALL_M / 2, wall_m))
    stage.wall((door_m + half_door + WALL_M / 2, wall_m), (x1, wall_m))
    stage.furnish(bounds, int(stage.rng.integers(2, 6)))
    return stage.finish(name, bounds, True)


EVERYDAY: dict[str, Callable[[Stage, str], Scenario]] = {
    "enters": _enters,
    "through-door": _through_door,
    "hidden-twin": _hidden_twin,
    "hug": _hug,
    "sits": _sits,
    "carries-box": _carries,
    "pushed": _pushed,
    "child": child,
}
"""By name, in the order of the tables."""
