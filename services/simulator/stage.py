"""Builds episodes: people and obstacles are put in place in a simple frame, then turned about.

In the frame of the stage the target starts at the origin and goes along x; the robot looks on
from behind. At the end all of it is mirrored and turned by quarters as the seed says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from heel.services.simulator.outfits import dress, twin_of
from heel.services.simulator.robot import wrap
from heel.services.simulator.script import Actor, Scenario
from heel.services.simulator.state import (
    Colour,
    Floor,
    Obstacle,
    ObstacleKind,
    RobotState,
    Role,
    Scenery,
)
from heel.services.simulator.walks import AnyLeg, Leg, Pushing, Walk

Array = NDArray[np.float64]
Place = tuple[float, float]

MAX_PEOPLE = 16
"""That a scenario may hold: so many outfits are made, so that adding a person dresses no other
anew."""
WALL_M = 0.2
"""Thickness; chosen by hand."""
WALL_HEIGHT_M = 2.6
"""Of a room; the usual."""
SHORTEST_S = 30.0
"""Of an episode; chosen by hand: long enough to lose the person and find them again."""
LONGEST_S = 60.0
"""Of an episode; chosen by hand: a set of episodes stays within hours."""
_CLEARANCE_M = 1.5
"""Between furniture and all ways, so that a robot that follows by sight alone meets none."""
_FURNITURE = (
    # length, width, height: cupboard, table, sofa, shelf, low cabinet.
    (1.2, 0.6, 1.9), (1.4, 0.8, 0.75), (1.9, 0.9, 0.8), (0.9, 0.35, 1.7), (1.0, 0.45, 0.9),
)  # fmt: skip


class Stage:
    """One episode in the making.

    Args:
        rng: all chance of the episode's start.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.actors: list[Actor] = []
        self.obstacles: list[Obstacle] = []
        self.lights: tuple[tuple[float, float], ...] = ()
        self.dropouts: tuple[tuple[float, float], ...] = ()
        outfits = dress(MAX_PEOPLE, rng)
        self._outfits = [outfits[0], *(outfits[i + 1] for i in rng.permutation(MAX_PEOPLE - 1))]
        ahead_m, beside_m = self.uniform(2.0, 3.5), self.uniform(-0.4, 0.4)
        back_m = math.sqrt(ahead_m**2 - beside_m**2)
        heading = math.atan2(-beside_m, back_m) + self.uniform(-0.25, 0.25)
        self.robot = RobotState(-back_m, beside_m, heading, 0.0, 0.0)

    def uniform(self, least: float, most: float) -> float:
        """A number between."""
        return float(self.rng.uniform(least, most))

    def add(
        self, role: Role, x_m: float, y_m: float, heading_rad: float, walk: Walk,
        height_m: float | None = None, radius_m: float | None = None, carries: bool = False,
    ) -> Actor:  # fmt: skip
        """Put a person in place; the target comes first, twins of it wear what it wears.

        Args:
            role, x_m, y_m, heading_rad, walk, carries: as in `Actor`.
            height_m, radius_m: of a person that is no adult on foot; None leaves them to chance.
        """
        outfit = self._outfits[len(self.actors)]
        adult_m = self.uniform(1.55, 1.95)
        if role == "twin":
            outfit = twin_of(self.actors[0].outfit, self.rng)
            adult_m = self.actors[0].height_m + self.uniform(-0.03, 0.03)
        broad_m = self.uniform(0.2, 0.25)
        actor = Actor(
            role=role,
            x_m=x_m,
            y_m=y_m,
            heading_rad=heading_rad,
            height_m=adult_m if height_m is None else height_m,
            radius_m=broad_m if radius_m is None else radius_m,
            stride_rad=self.uniform(0.0, 2 * math.pi),
            outfit=outfit,
            walk=walk,
            carries=carries,
        )
        self.actors.append(actor)
        return actor

    def put(
        self, kind: ObstacleKind, place: Place, size: tuple[float, float, float],
        heading_rad: float = 0.0,
    ) -> None:  # fmt: skip
        """Put an obstacle in place; size is length, width and height."""
        grey = self.uniform(150, 225) if kind != "furniture" else self.uniform(60, 200)
        tint = self.rng.uniform(-1, 1, 3) * (12 if kind != "furniture" else 55)
        red, green, blue = (round(min(max(grey + float(t), 0.0), 255.0)) for t in tint)
        colour: Colour = (red, green, blue)
        self.obstacles.append(Obstacle(kind, *place, heading_rad, *size, colour))

    def wall(self, start: Place, end: Place) -> None:
        """A wall from corner to corner."""
        length = math.dist(start, end)
        middle = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
        heading = math.atan2(end[1] - start[1], end[0] - start[0])
        self.put("wall", middle, (length + WALL_M, WALL_M, WALL_HEIGHT_M), heading)

    def walls_around(self, bounds: tuple[float, float, float, float]) -> None:
        """The four walls of a room."""
        x0, y0, x1, y1 = bounds
        corners = ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
        for index, corner in enumerate(corners):
            self.wall(corner, corners[(index + 1) % 4])

    def extent(self, margin_m: float) -> tuple[float, float, float, float]:
        """The rectangle around all ways and the robot, wider by a margin."""
        points = np.vstack([*self._ways(), [(self.robot.x_m, self.robot.y_m)]])
        x0, y0 = (points.min(0) - margin_m).tolist()
        x1, y1 = (points.max(0) + margin_m).tolist()
        return x0, y0, x1, y1

    def furnish(self, bounds: tuple[float, float, float, float], pieces: int) -> None:
        """Scatter furniture where no person walks; fewer pieces where there is no room."""
        ways = self._ways()
        # The robot comes along the target's way, from where it stands.
        ways[0] = np.vstack([[(self.robot.x_m, self.robot.y_m)], ways[0]])
        for _ in range(8 * pieces):
            if pieces == 0:
                return
            size = _FURNITURE[int(self.rng.integers(len(_FURNITURE)))]
            reach = math.hypot(size[0], size[1]) / 2
            x_m = self.uniform(bounds[0] + reach + WALL_M, bounds[2] - reach - WALL_M)
            y_m = self.uniform(bounds[1] + reach + WALL_M, bounds[3] - reach - WALL_M)
            free = min(_distance_to_way((x_m, y_m), way) for way in ways) - reach
            apart = min((_gap((x_m, y_m), o) for o in self.obstacles), default=math.inf) - reach
            if free > _CLEARANCE_M and apart > 0.3:
                self.put("furniture", (x_m, y_m), size, self.uniform(-math.pi, math.pi))
                pieces -= 1

    def surround(self) -> tuple[tuple[float, float, float, float], bool]:
        """A hall or open ground around all, furnished; returns its bounds, and which."""
        indoors = bool(self.rng.random() < 0.5)
        bounds = self.extent(self.uniform(2.0, 3.5) if indoors else 6.0)
        if indoors:
            self.walls_around(bounds)
        self.furnish(bounds, int(self.rng.integers(4, 12)))
        return bounds, indoors

    def finish(
        self, name: str, bounds: tuple[float, float, float, float], indoors: bool
    ) -> Scenario:
        """The episode, mirrored and turned about."""
        floors: tuple[Floor, Floor] = ("tiles", "wood") if indoors else ("asphalt", "grass")
        floor = floors[int(self.rng.integers(2))]
        turn = _Turn(bool(self.rng.random() < 0.5), int(self.rng.integers(4)))
        corners = [turn.place(bounds[0], bounds[1]), turn.place(bounds[2], bounds[3])]
        (x0, x1), (y0, y1) = (sorted(c[axis] for c in corners) for axis in (0, 1))
        return Scenario(
            name=name,
            duration_s=self._duration_s(),
            scenery=Scenery(
                (x0, y0, x1, y1), indoors, floor, tuple(turn.obstacle(o) for o in self.obstacles)
            ),
            robot=turn.robot(self.robot),
            people=tuple(turn.actor(actor) for actor in self.actors),
            lights=self.lights,
            dropouts=self.dropouts,
        )

    def _duration_s(self) -> float:
        walk = self.actors[0].walk
        needed = walk.start_s + 6.0
        way = self._ways()[0]
        needed += float(np.hypot(*np.diff(way, axis=0).T).sum()) / walk.speed_mps
        for leg in walk.legs:
            if isinstance(leg, Leg):
                needed += leg.pause_s + leg.hidden_s
        return round(min(max(needed, SHORTEST_S), LONGEST_S), 1)

    def _ways(self) -> list[Array]:
        """The places of all one after the other, each (K, 2)."""
        return [
            np.array(
                [(a.x_m, a.y_m)]
                + [(leg.x_m, leg.y_m) for leg in a.walk.legs if isinstance(leg, Leg)]
            )
            for a in self.actors
        ]


def _gap(place: Place, obstacle: Obstacle) -> float:
    """From a point to an obstacle, at least; walls are kept off by the bounds of the room."""
    if obstacle.kind == "wall":
        return math.inf
    reach = math.hypot(obstacle.length_m, obstacle.width_m) / 2
    return math.dist(place, (obstacle.x_m, obstacle.y_m)) - reach


def _distance_to_way(place: Place, way: Array) -> float:
    """From a point to a line of segments (K, 2)."""
    point = np.array(place)
    if len(way) == 1:
        return float(np.hypot(*(way[0] - point)))
    start, along = way[:-1], np.diff(way, axis=0)
    squared = np.maximum((along * along).sum(1), 1e-9)
    share = np.clip(((point - start) * along).sum(1) / squared, 0.0, 1.0)
    offset = start + share[:, None] * along - point
    return float(np.hypot(offset[:, 0], offset[:, 1]).min())


@dataclass(frozen=True)
class _Turn:
    """Mirrors at the x axis, then turns by quarters about the origin."""

    mirrored: bool
    quarters: int

    def place(self, x_m: float, y_m: float) -> Place:
        y_m = -y_m if self.mirrored else y_m
        for _ in range(self.quarters):
            x_m, y_m = -y_m, x_m
        return x_m, y_m

    def heading(self, heading_rad: float) -> float:
        mirrored = -heading_rad if self.mirrored else heading_rad
        return wrap(mirrored + self.quarters * math.pi / 2)

    def obstacle(self, thing: Obstacle) -> Obstacle:
        x_m, y_m = self.place(thing.x_m, thing.y_m)
        return replace(thing, x_m=x_m, y_m=y_m, heading_rad=self.heading(thing.heading_rad))

    def robot(self, thing: RobotState) -> RobotState:
        x_m, y_m = self.place(thing.x_m, thing.y_m)
        return replace(thing, x_m=x_m, y_m=y_m, heading_rad=self.heading(thing.heading_rad))

    def actor(self, thing: Actor) -> Actor:
        x_m, y_m = self.place(thing.x_m, thing.y_m)
        walk = replace(thing.walk, legs=tuple(self._leg(leg) for leg in thing.walk.legs))
        heading = self.heading(thing.heading_rad)
        return replace(thing, x_m=x_m, y_m=y_m, heading_rad=heading, walk=walk)

    def _leg(self, leg: AnyLeg) -> AnyLeg:
        if isinstance(leg, Pushing):
            return leg
        x_m, y_m = self.place(leg.x_m, leg.y_m)
        return replace(leg, x_m=x_m, y_m=y_m)
