"""Everything that stands still, as one scene graph."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from heel.services.simulator.render import props, surfaces
from heel.services.simulator.render.grounds import PERIOD_M, ground
from heel.services.simulator.render.materials import texture
from heel.services.simulator.render.meshes import Mesh, joined, loft, node, patch
from heel.services.simulator.render.noise import Picture
from heel.services.simulator.render.panda import core
from heel.services.simulator.state import Obstacle, Scenery

FLOOR_SORT = 10
"""Order of drawing: the floor comes first."""
SHADOW_SORT = 20
"""Shadows come on the floor, before everything else."""
Area = tuple[float, float, float, float]
_CELL_M = 1.5
"""Side of a piece of floor or wall that has one brightness; chosen by hand: small enough for light
to fade smoothly."""
_CHUNK_M = 9.0
"""Floor is culled in squares of this side; chosen by hand: a room is one or a few."""
_OUTSIDE_M = 36.0
"""Ground reaches so far beyond the world outdoors; chosen by hand."""
_OUTSIDE_CELL_M = 4.0
"""And in coarser pieces, since no light fades there."""
_CEILING_M = 2.8
"""Height of a room without walls of its own; the usual."""
_FAR_RADIUS_M = 100.0
"""Of the drum on which the horizon is painted: walks of some metres do not shift it."""
_POSTER_EVERY_M = 1.5
"""Of wall; chosen by hand: enough marks for a camera that turns."""
_OFF_WALL_M = 0.012
"""In front of the wall, so that depth decides which of the two is drawn at any distance."""
_SUN = (0.35, -0.55, -0.76)
"""Direction in which the light falls; oblique, so that sides differ in shade."""


class Stage:
    """Floor, obstacles, ceiling or sky, and the light.

    Args:
        scenery: what there is.
        seed: of every texture and of the pictures on the walls.
    """

    def __init__(self, scenery: Scenery, seed: int) -> None:
        self.root = core.NodePath("stage")
        self._rng = np.random.default_rng([seed, 31])
        self._seed = seed
        self._far = self._put("far", [_far_view()], surfaces.panorama(seed))
        self._far.set_bin("background", 0)
        self._far.set_depth_write(False)
        self._far.set_light_off()
        floor = self._put("floor", _floor(scenery), ground(scenery.floor, seed))
        floor.set_bin("background", FLOOR_SORT)
        self._posters = texture("posters", surfaces.posters(seed))
        for obstacle in scenery.obstacles:
            self._add(obstacle, scenery.indoors)
        if scenery.indoors:
            ceiling = self._put("ceiling", _ceiling(scenery), surfaces.ceiling(seed))
            ceiling.set_light_off()
        self._shine(scenery.indoors)

    def centre_far_view(self, x_m: float, y_m: float, z_m: float) -> None:
        """Keep the horizon out of reach of the camera."""
        self._far.set_pos(x_m, y_m, z_m)

    def _put(self, name: str, pieces: Sequence[Mesh], picture: Picture) -> Any:
        """One picture on several pieces, of which only those in view are drawn."""
        holder = self.root.attach_new_node(name)
        holder.set_texture(texture(name, picture))
        for piece in pieces:
            node(name, piece).reparent_to(holder)
        return holder

    def _add(self, obstacle: Obstacle, indoors: bool) -> None:
        kind = int(self._rng.integers(surfaces.FURNITURE_KINDS))
        if obstacle.look in ("coat stand", "glass"):
            self._stand(obstacle)
            return
        picture = self._picture(obstacle, indoors, kind)
        length, width, height = obstacle.length_m, obstacle.width_m, obstacle.height_m
        faces = list(_faces(obstacle, whole=obstacle.kind == "furniture"))
        shape = node(obstacle.kind, joined(faces), obstacle.colour)
        shape.set_texture(texture(obstacle.kind, picture))
        shape.reparent_to(self.root)
        shape.set_pos(obstacle.x_m, obstacle.y_m, 0.0)
        shape.set_h(math.degrees(obstacle.heading_rad))
        if obstacle.kind == "wall" and height > 1.6:
            for y, turn in ((-width / 2, 0.0), (width / 2, 180.0)):
                self._hang_posters(shape, length, y, turn)

    def _stand(self, obstacle: Obstacle) -> None:
        """What is no box."""
        glass = obstacle.look == "glass"
        shapes = (
            [props.frame_of_glass(obstacle)] if glass else props.coat_stand(obstacle, self._seed)
        )
        for shape in shapes:
            shape.reparent_to(self.root)
            shape.set_pos(obstacle.x_m, obstacle.y_m, 0.0)
            shape.set_h(math.degrees(obstacle.heading_rad))

    def _picture(self, obstacle: Obstacle, indoors: bool, kind: int) -> Picture:
        if obstacle.look == "drawn person":
            return props.drawn_person(self._seed)
        if obstacle.look == "clothes":
            return props.dressed_front(self._seed)
        if obstacle.kind == "furniture":
            return surfaces.furniture(self._seed, kind)
        if obstacle.kind == "pillar":
            return surfaces.concrete(self._seed)
        return surfaces.plaster(self._seed) if indoors else surfaces.bricks(self._seed)

    def _hang_posters(self, wall: Any, length_m: float, y_m: float, turn_deg: float) -> None:
        hung = []
        for place in np.arange(0.7, length_m - 1.1, _POSTER_EVERY_M):
            wide, high, low = self._rng.uniform((0.45, 0.5, 0.9), (1.0, 1.1, 1.25))
            left = place - length_m / 2 + float(self._rng.uniform(0, 0.4))
            which = self._rng.integers(surfaces.POSTERS_A_SIDE, size=2).astype(np.float32)
            if self._rng.random() < 0.75:
                share = 1 / surfaces.POSTERS_A_SIDE
                sheet = patch((left, -_OFF_WALL_M, low), (wide, 0, 0), (0, 0, high),
                              (share, share), (1, 1))  # fmt: skip
                hung.append(replace(sheet, uv=sheet.uv + which * np.float32(share)))
        if hung:
            side = node("posters", joined(hung))
            side.set_texture(self._posters)
            side.set_pos_hpr(0.0, y_m, 0.0, turn_deg, 0.0, 0.0)
            side.reparent_to(wall)

    def _shine(self, indoors: bool) -> None:
        ambient, sun = core.AmbientLight("ambient"), core.DirectionalLight("sun")
        ambient.set_color((0.74, 0.74, 0.75, 1) if indoors else (0.52, 0.55, 0.62, 1))
        sun.set_color((0.4, 0.39, 0.37, 1) if indoors else (0.62, 0.59, 0.52, 1))
        sun.set_direction(core.Vec3(*_SUN))
        self.lights = tuple(self.root.attach_new_node(light) for light in (ambient, sun))


def _floor(scenery: Scenery) -> list[Mesh]:
    """The floor within the bounds, and open ground around it where there is no room."""
    left, bottom, right, top = scenery.bounds_m
    inner = _tiled((left, bottom, right, top), _CHUNK_M, _CELL_M)
    if scenery.indoors:
        return inner
    out = _OUTSIDE_M
    around = (
        (left - out, bottom - out, right + out, bottom), (left - out, top, right + out, top + out),
        (left - out, bottom, left, top), (right, bottom, right + out, top),
    )  # fmt: skip
    return [*inner, *(piece for area in around for piece in _tiled(area, out, _OUTSIDE_CELL_M))]


def _tiled(area: Area, chunk_m: float, cell_m: float) -> list[Mesh]:
    """An area of the ground in pieces of at most `chunk_m`."""
    left, bottom, right, top = area
    columns, rows = _cuts(left, right, chunk_m), _cuts(bottom, top, chunk_m)
    return [
        _ground_patch((x, y, next_x, next_y), cell_m)
        for x, next_x in pairwise(columns)
        for y, next_y in pairwise(rows)
    ]


def _cuts(low: float, high: float, step: float) -> list[float]:
    count = max(1, math.ceil((high - low) / step))
    return [low + (high - low) * index / count for index in range(count + 1)]


def _ground_patch(area: Area, cell_m: float) -> Mesh:
    left, bottom, right, top = area
    across, deep = right - left, top - bottom
    cells = max(1, math.ceil(across / cell_m)), max(1, math.ceil(deep / cell_m))
    mesh = patch((left, bottom, 0), (across, 0, 0), (0, deep, 0), (1, 1), cells)
    # The pattern belongs to the place, so that neighbouring patches meet.
    return replace(mesh, uv=(mesh.vertices[:, :2] / PERIOD_M).astype(np.float32))


def _ceiling(scenery: Scenery) -> list[Mesh]:
    left, bottom, right, top = scenery.bounds_m
    walls = [thing.height_m for thing in scenery.obstacles if thing.kind == "wall"]
    height = max(walls, default=_CEILING_M)
    period = surfaces.CEILING_PERIOD_M
    pieces = []
    for x, next_x in pairwise(_cuts(left, right, 4 * period)):
        for y, next_y in pairwise(_cuts(bottom, top, 4 * period)):
            across, deep = next_x - x, next_y - y
            panel = patch((x, next_y, height), (across, 0, 0), (0, -deep, 0), (1, 1), (4, 4))
            uv = (panel.vertices[:, :2] / period).astype(np.float32)
            pieces.append(replace(panel, uv=uv))
    return pieces


def _far_view() -> Mesh:
    """A drum around the camera whose inside carries the panorama; its horizon is at height 0."""
    high = 2 * math.pi * _FAR_RADIUS_M * 512 / 2048
    low = -high * 112 / 512
    rings = np.linspace(low, low + high, 9)
    drum = loft([(float(z), _FAR_RADIUS_M, _FAR_RADIUS_M, 0.0) for z in rings], sides=48)
    inside = drum.triangles[:, ::-1]
    return Mesh(drum.vertices, -drum.normals, drum.uv, np.ascontiguousarray(inside))


def _faces(obstacle: Obstacle, whole: bool) -> Iterator[Mesh]:
    """Sides and top of an upright box around the origin.

    Args:
        obstacle: its size.
        whole: one picture a side, instead of a pattern that repeats with the metre.
    """
    x, y, z = obstacle.length_m / 2, obstacle.width_m / 2, obstacle.height_m
    sides = (
        ((x, -y, 0.0), (0.0, 2 * y, 0.0)), ((x, y, 0.0), (-2 * x, 0.0, 0.0)),
        ((-x, y, 0.0), (0.0, -2 * y, 0.0)), ((-x, -y, 0.0), (2 * x, 0.0, 0.0)),
    )  # fmt: skip
    rows = max(1, math.ceil(z / _CELL_M))
    for origin, along in sides:
        long = math.hypot(*along)
        repeats = 1.0 if whole else long / surfaces.WALL_PERIOD_M
        cells = max(1, math.ceil(long / _CELL_M)), rows
        yield patch(origin, along, (0, 0, z), (repeats, 1.0), cells)
    cells = max(1, math.ceil(2 * x)), max(1, math.ceil(2 * y))
    yield patch((-x, -y, z), (2 * x, 0, 0), (0, 2 * y, 0), (0.2, 0.2), cells)
