"""The episodes by name; every seed makes another one of the same kind."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable

import numpy as np

from heel.services.simulator.errors import SimulatorError
from heel.services.simulator.everyday_scenarios import EVERYDAY
from heel.services.simulator.posture_scenarios import POSTURES
from heel.services.simulator.script import Scenario
from heel.services.simulator.stage import WALL_HEIGHT_M, WALL_M, Place, Stage
from heel.services.simulator.state import Role
from heel.services.simulator.walks import Crossing, Leg, Walk
from heel.services.simulator.ways import gentle, send, sign, start, wander
from heel.services.simulator.world import World


def scenario(name: str, seed: int) -> World:
    """A world at the start of an episode.

    Raises:
        SimulatorError: no such name.
    """
    if name not in EVERY:
        raise SimulatorError(f"no scenario {name!r}: choose one of {', '.join(EVERY)}")
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    script = EVERY[name](Stage(rng), name)
    return World(script, seed)


def _straight(stage: Stage, name: str) -> Scenario:
    speed = stage.uniform(0.7, 1.25)
    length = speed * stage.uniform(26, 40)
    send(stage, speed, [(length / 2, stage.uniform(-0.5, 0.5)), (length, 0.0)])
    _bystanders(stage, int(stage.rng.integers(0, 3)))
    return stage.finish(name, *stage.surround())


def _turns(stage: Stage, name: str) -> Scenario:
    speed = stage.uniform(0.7, 1.2)
    points = wander(stage, speed * stage.uniform(28, 45), (3.0, 6.0), (0.7, 1.75), 2.0)
    send(stage, speed, points)
    return stage.finish(name, *stage.surround())


def _stop_and_go(stage: Stage, name: str) -> Scenario:
    speed = stage.uniform(0.8, 1.25)
    points = gentle(stage, speed * stage.uniform(20, 28))
    stops = int(stage.rng.integers(3, 6))
    where = stage.rng.choice(len(points) - 1, min(stops, len(points) - 1), replace=False)
    send(stage, speed, points, {int(index): stage.uniform(2.0, 6.0) for index in where})
    _bystanders(stage, int(stage.rng.integers(0, 3)))
    return stage.finish(name, *stage.surround())


def _stands_still(stage: Stage, name: str) -> Scenario:
    speed = stage.uniform(0.8, 1.2)
    points = gentle(stage, speed * stage.uniform(14, 26))
    send(stage, speed, points, {int(stage.rng.integers(len(points) - 1)): 20.0})
    _bystanders(stage, int(stage.rng.integers(0, 3)))
    return stage.finish(name, *stage.surround())


def _pillar(stage: Stage, name: str) -> Scenario:
    """Turns round the end of a broad pillar beside the way, out of view for 3 s, and steps out.

    Turned round, because a robot that follows closely sees round a corner that is only turned at.
    """
    speed = stage.uniform(0.7, 1.0)
    length, depth = stage.uniform(2.2, 2.8), stage.uniform(0.5, 0.8)
    end_m, beside_m = stage.uniform(7.0, 11.0), stage.uniform(0.8, 0.95)
    behind = -beside_m - depth
    out = end_m + stage.uniform(2.6, 3.4), 0.0
    legs = (
        Leg(end_m + 0.2, 0.0),
        Leg(end_m + 0.5, behind - 0.3),
        Leg(end_m - 0.3 * length, behind - 0.5, hidden_s=2.3),
        # Comes out near enough that a robot that waits need not drive before the way is clear.
        Leg(end_m + 0.5, behind - 0.2),
        Leg(end_m + 0.8, -0.1),
        Leg(*out),
        *(Leg(*point) for point in gentle(stage, speed * stage.uniform(14, 22), out)),
    )
    start(stage, speed, legs)
    middle = end_m - length / 2, -beside_m - depth / 2
    stage.put("pillar", middle, (length, depth, WALL_HEIGHT_M))
    return stage.finish(name, *stage.surround())


def _doorway(stage: Stage, name: str) -> Scenario:
    """Turns aside through a door, stays out of view behind the wall for 10 s, and comes back."""
    speed = stage.uniform(0.7, 1.0)
    door_m, half_door = stage.uniform(7.0, 10.0), stage.uniform(0.75, 0.9)
    wall_m, room_m = -stage.uniform(0.9, 1.1), stage.uniform(4.0, 6.0)
    inside = wall_m - WALL_M / 2 - 0.5
    out = door_m + stage.uniform(2.0, 2.6), 0.0
    legs = (
        Leg(door_m - 0.1, 0.0),
        Leg(door_m, inside),
        Leg(door_m - half_door - 1.2, inside, hidden_s=9.5),
        Leg(door_m + 0.3, inside),
        Leg(door_m + 0.5, wall_m + 0.4),
        Leg(*out),
        # On along the wall or away from it, never through.
        *(Leg(x, abs(y)) for x, y in gentle(stage, speed * stage.uniform(8, 16), out)),
    )
    start(stage, speed, legs)
    x0, _, x1, y1 = stage.extent(stage.uniform(2.0, 3.0))
    bounds = x0, wall_m - room_m, x1, y1
    stage.walls_around(bounds)
    stage.wall((x0, wall_m), (door_m - half_door - WALL_M / 2, wall_m))
    stage.wall((door_m + half_door + WALL_M / 2, wall_m), (x1, wall_m))
    stage.furnish(bounds, int(stage.rng.integers(3, 9)))
    return stage.finish(name, bounds, True)


def _distractors(count: int) -> Callable[[Stage, str], Scenario]:
    def make(stage: Stage, name: str) -> Scenario:
        speed = stage.uniform(0.7, 1.1)
        way = gentle(stage, speed * stage.uniform(30, 42))
        send(stage, speed, way)
        _crossers(stage, way, ["other"] * count)
        return stage.finish(name, *stage.surround())

    return make


def _twin(stage: Stage, name: str) -> Scenario:
    """A twin crosses between or comes the other way, close by; perhaps another person crosses."""
    speed = stage.uniform(0.7, 1.1)
    way = gentle(stage, speed * stage.uniform(30, 42))
    send(stage, speed, way)
    if stage.rng.random() < 0.6:
        others: list[Role] = ["other"] * int(stage.rng.integers(0, 2))
        _crossers(stage, way, ["twin", *others])
    else:
        side, pace = stage.uniform(1.3, 1.8) * sign(stage), stage.uniform(0.8, 1.2)
        back = [(x_m, y_m + side) for x_m, y_m in reversed([(0.0, 0.0), *way])]
        legs = tuple(Leg(*point) for point in [*back[1:], (-6.0, side)])
        stage.add("twin", *back[0], math.pi, Walk(pace, legs, start_s=stage.uniform(0, 6)))
    return stage.finish(name, *stage.surround())


def _light_switch(stage: Stage, name: str) -> Scenario:
    speed = stage.uniform(0.7, 1.2)
    send(stage, speed, gentle(stage, speed * stage.uniform(28, 40)))
    _bystanders(stage, int(stage.rng.integers(1, 4)))
    dark = stage.rng.random() < 0.75
    level = stage.uniform(0.3, 0.6) if dark else stage.uniform(1.5, 2.0)
    times = np.cumsum([stage.uniform(7, 11), *stage.rng.uniform(5, 9, 3)]).tolist()
    stage.lights = tuple((t_s, (level, 1.0)[index % 2]) for index, t_s in enumerate(times))
    return stage.finish(name, *stage.surround())


def _crowd(stage: Stage, name: str) -> Scenario:
    """Along a corridor with people in both directions."""
    speed = stage.uniform(0.7, 1.1)
    length, half = speed * stage.uniform(30, 42), stage.uniform(2.4, 3.0)
    send(stage, speed, [(length / 2, stage.uniform(-0.4, 0.4)), (length, 0.0)])
    for index in range(int(stage.rng.integers(6, 10))):
        lane, row = stage.uniform(0.8, half - 0.5) * sign(stage), index // 3
        # One behind the other, so that none begins on another's feet.
        if index % 3 == 0:
            start = 3.0 + 2.5 * row + stage.uniform(0.0, 1.5)
            walk = Walk(speed * stage.uniform(0.8, 1.15), (Leg(length + 3.0, lane),))
            stage.add("other", start, lane, 0.0, walk)
            continue
        begin = 0.0
        if index % 3 == 1:
            start = 11.0 + (length - 11.0) / 3 * (row + stage.uniform(0.1, 0.9))
        else:
            start, begin = length + 2.0 + row, stage.uniform(6.0, 20.0)
        walk = Walk(stage.uniform(0.8, 1.3), (Leg(-7.0, lane),), start_s=begin)
        stage.add("other", start, lane, math.pi, walk)
    bounds = -9.0, -half, length + 5.0, half
    stage.walls_around(bounds)
    return stage.finish(name, bounds, True)


def _drop_out(stage: Stage, name: str) -> Scenario:
    speed = stage.uniform(0.7, 1.1)
    send(stage, speed, gentle(stage, speed * stage.uniform(28, 40)))
    _bystanders(stage, int(stage.rng.integers(0, 3)))
    starts = np.cumsum(stage.rng.uniform(7, 11, int(stage.rng.integers(2, 4)))).tolist()
    stage.dropouts = tuple((from_s, from_s + stage.uniform(0.5, 2.5)) for from_s in starts)
    return stage.finish(name, *stage.surround())


SCENARIOS: dict[str, Callable[[Stage, str], Scenario]] = {
    "straight": _straight,
    "turns": _turns,
    "stop-and-go": _stop_and_go,
    "stands-still": _stands_still,
    "pillar": _pillar,
    "doorway": _doorway,
    "distractor-1": _distractors(1),
    "distractor-2": _distractors(2),
    "distractor-3": _distractors(3),
    "distractor-4": _distractors(4),
    "twin": _twin,
    "light-switch": _light_switch,
    "crowd": _crowd,
    "drop-out": _drop_out,
}
"""By name, in the order of the tables; the number of a `distractor` is of people that cross."""
EVERY = SCENARIOS | EVERYDAY | POSTURES


def _bystanders(stage: Stage, count: int) -> None:
    """People that stand or stroll beside the target's way, well off it and far from the start."""
    far = max(leg.x_m for leg in stage.actors[0].walk.legs if isinstance(leg, Leg))
    rows = [leg.y_m for leg in stage.actors[0].walk.legs if isinstance(leg, Leg)]
    for _ in range(count):
        side = sign(stage)
        edge = max(side * row for row in [0.0, *rows])
        x_m, y_m = stage.uniform(5.0, far), side * (edge + stage.uniform(2.5, 4.0))
        legs: tuple[Leg, ...] = ()
        if stage.rng.random() < 0.5:
            legs = (Leg(stage.uniform(0.0, far), y_m + side * stage.uniform(0.0, 1.0)),)
        walk = Walk(stage.uniform(0.6, 1.2), legs, start_s=stage.uniform(0.0, 10.0))
        stage.add("other", x_m, y_m, stage.uniform(-math.pi, math.pi), walk)


def _crossers(stage: Stage, way: list[Place], roles: list[Role]) -> None:
    """People beside the way that cross it just behind the target, one by one."""
    points = np.array([(0.0, 0.0), *way])
    steps = np.diff(points, axis=0)
    # Not on the first leg, and not near corners, which people round off.
    share = (np.arange(len(roles)) + stage.rng.uniform(0.2, 0.8, len(roles))) / len(roles)
    for role, leg in zip(roles, (1 + share * (len(steps) - 2)).tolist(), strict=True):
        place = points[int(leg)] + stage.uniform(0.35, 0.65) * steps[int(leg)]
        along = steps[int(leg)] / np.hypot(*steps[int(leg)])
        across = sign(stage) * np.array([-along[1], along[0]])
        x_m, y_m = place.tolist()
        start_x, start_y = (place + stage.uniform(2.5, 4.0) * across).tolist()
        end_x, end_y = (place - stage.uniform(4.0, 5.0) * across).tolist()
        legs = Crossing(x_m, y_m, stage.uniform(0.5, 0.6)), Leg(end_x, end_y)
        facing = math.atan2(-float(across[1]), -float(across[0]))
        stage.add(role, start_x, start_y, facing, Walk(stage.uniform(1.0, 1.3), legs))
