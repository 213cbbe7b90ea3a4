"""Worlds with only what a test asks for, and who follows the target with its eyes on the truth."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from heel.schemas import FrameId
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.script import Actor, Scenario
from heel.services.simulator.solids import Solids
from heel.services.simulator.state import (
    CameraMount,
    Obstacle,
    ObstacleKind,
    Outfit,
    RobotState,
    Role,
    Scenery,
)
from heel.services.simulator.views import Sight, look
from heel.services.simulator.walks import Walk
from heel.services.simulator.world import World

MOUNT = CameraMount()
RED = Outfit((30, 26, 28), (224, 180, 150), (200, 30, 30), (40, 40, 44), (28, 26, 26))
BLUE = Outfit((30, 26, 28), (224, 180, 150), (30, 30, 200), (40, 40, 44), (28, 26, 26))


def actor(
    x_m: float, y_m: float, walk: Walk | None = None, *, role: Role = "target",
    outfit: Outfit = RED, heading_rad: float = 0.0, height_m: float = 1.75,
) -> Actor:  # fmt: skip
    """Somebody who stands still unless given a walk."""
    return Actor(
        role=role,
        x_m=x_m,
        y_m=y_m,
        heading_rad=heading_rad,
        height_m=height_m,
        radius_m=0.22,
        stride_rad=0.0,
        outfit=outfit,
        walk=walk or Walk(1.0),
    )


def box(
    x_m: float, y_m: float, length_m: float, width_m: float, height_m: float = 2.6,
    heading_rad: float = 0.0, kind: ObstacleKind = "wall",
) -> Obstacle:  # fmt: skip
    """An obstacle in grey."""
    return Obstacle(kind, x_m, y_m, heading_rad, length_m, width_m, height_m, (128, 128, 128))


def world(
    *people: Actor,
    obstacles: tuple[Obstacle, ...] = (),
    robot: RobotState | None = None,
    seed: int = 0,
    lights: tuple[tuple[float, float], ...] = (),
    dropouts: tuple[tuple[float, float], ...] = (),
) -> World:
    """A world with the robot at the origin, looking along x; without people, one far behind."""
    script = Scenario(
        name="empty",
        duration_s=60.0,
        scenery=Scenery((-20.0, -20.0, 20.0, 20.0), False, "tiles", obstacles),
        robot=robot or RobotState(0.0, 0.0, 0.0, 0.0, 0.0),
        people=people or (actor(-50.0, 0.0),),
        lights=lights,
        dropouts=dropouts,
    )
    return World(script, seed)


def frame(seq: int = 0) -> FrameId:
    """The name of a frame."""
    return FrameId(stream="cam", epoch=1, seq=seq, index=seq, t_capture_ns=seq * 50_000_000)


def sight_of(it: World) -> Sight:
    """Everybody as seen by the robot."""
    return look(it, Solids(it.scenery.obstacles), MOUNT)


@dataclass
class Episode:
    """What happened while the target was followed."""

    world: World
    visible: list[bool] = field(default_factory=list)
    distance_m: list[float] = field(default_factory=list)
    nearest_other_m: float = math.inf
    between: set[int] = field(default_factory=set)
    deepest_in_wall_m: float = 0.0
    step_s: float = 0.0

    @property
    def longest_hidden_s(self) -> float:
        """The longest time without a sight of the target."""
        longest = run = 0
        for seen in self.visible:
            run = 0 if seen else run + 1
            longest = max(longest, run)
        return longest * self.step_s


def follow(name: str, seed: int, step_s: float = 0.04) -> Episode:
    """Keep 1.5 m behind the target while it is to be seen, wait while it is not."""
    it = scenario(name, seed)
    episode = Episode(it, step_s=step_s)
    solids = Solids(it.scenery.obstacles)
    target = next(i for i, p in enumerate(it.scenario.people) if p.role == "target")
    while not it.finished:
        if len(episode.visible) % 2 == 0:
            seen = it.camera_on and look(it, solids, MOUNT).visible[target] > 0.15
        it.step(step_s, *(_chase(it) if seen else (0.0, 0.0)))
        _note(episode, bool(seen), solids)
    return episode


def _chase(it: World) -> tuple[float, float]:
    robot, target = it.robot, it.target
    away, bearing = _polar(it, target.x_m, target.y_m)
    along = target.speed_mps * math.cos(target.heading_rad - robot.heading_rad - bearing)
    speed = min(max(1.5 * (away - 1.5) + along, 0.0), 1.4) * max(math.cos(bearing), 0.0)
    for person in it.people:
        near_m, side = _polar(it, person.x_m, person.y_m)
        if person.role != "target" and abs(side) < 0.9:
            speed = min(speed, max(near_m - 0.8, 0.0))
    return speed, min(max(2.5 * bearing, -1.8), 1.8)


def _polar(it: World, x_m: float, y_m: float) -> tuple[float, float]:
    offset_x, offset_y = x_m - it.robot.x_m, y_m - it.robot.y_m
    bearing = math.remainder(math.atan2(offset_y, offset_x) - it.robot.heading_rad, 2 * math.pi)
    return math.hypot(offset_x, offset_y), bearing


def _note(episode: Episode, seen: bool, solids: Solids) -> None:
    it = episode.world
    episode.visible.append(seen)
    away, bearing = _polar(it, it.target.x_m, it.target.y_m)
    episode.distance_m.append(away)
    for person in it.people:
        if person.role != "target":
            near_m, side = _polar(it, person.x_m, person.y_m)
            episode.nearest_other_m = min(episode.nearest_other_m, near_m)
            if near_m < away and abs(math.remainder(side - bearing, 2 * math.pi)) < 0.15:
                episode.between.add(person.id)
    place = np.array([(p.x_m, p.y_m) for p in it.people])
    radius = np.array([p.radius_m for p in it.people])
    if len(solids):
        depth = radius[:, None] - solids.clearance(place)[0]
        episode.deepest_in_wall_m = max(episode.deepest_in_wall_m, float(depth.max()))
