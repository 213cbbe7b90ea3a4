"""Shapes as arrays, and arrays as nodes of the scene graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heel.services.simulator.render.panda import core
from heel.services.simulator.state import Colour

Floats = NDArray[np.float32]
Section = tuple[float, float, float, float]
"""Height, half depth (along x), half width (along y), and shift along x; metres."""


@dataclass(frozen=True)
class Mesh:
    """A surface: metres, unit normals, texture coordinates, triangles.

    Attributes:
        vertices: (N, 3) float32.
        normals: (N, 3) float32.
        uv: (N, 2) float32.
        triangles: (T, 3) int.
    """

    vertices: Floats
    normals: Floats
    uv: Floats
    triangles: NDArray[np.int32]

    def moved(self, x_m: float, y_m: float, z_m: float) -> Mesh:
        """The same surface elsewhere."""
        shift = np.array([x_m, y_m, z_m], np.float32)
        return Mesh(self.vertices + shift, self.normals, self.uv, self.triangles)


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Several surfaces as one, which is drawn faster."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.uv for mesh in meshes]),
        np.concatenate([m.triangles + start for m, start in zip(meshes, starts, strict=False)]),
    )


def patch(
    origin: ArrayLike, along: ArrayLike, up: ArrayLike,
    uv_size: tuple[float, float], cells: tuple[int, int],
) -> Mesh:  # fmt: skip
    """A flat parallelogram in cells: texture bends visibly across large triangles (measured).

    Args:
        origin: corner, metres.
        along: first side, metres.
        up: second side, metres; the normal is along x up.
        uv_size: texture repeats along both sides.
        cells: cells along both sides, at least 1.
    """
    columns, rows = cells[0] + 1, cells[1] + 1
    u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    u, v = u.reshape(-1, 1), v.reshape(-1, 1)
    first, second = np.asarray(along, float), np.asarray(up, float)
    normal = np.cross(first, second)
    normal /= np.linalg.norm(normal)
    return Mesh(
        (np.asarray(origin, float) + u * first + v * second).astype(np.float32),
        np.tile(normal, (len(u), 1)).astype(np.float32),
        np.hstack([u * uv_size[0], v * uv_size[1]]).astype(np.float32),
        _grid(rows, columns),
    )


def loft(sections: Sequence[Section], sides: int = 10, flat_ends: bool = False) -> Mesh:
    """A tube through elliptic sections from bottom to top: limbs, torsos, heads, pillars.

    Texture coordinates run once around (u 0.5 is ahead, along x) and once up.

    Args:
        sections: at least two, by rising height.
        sides: corners of a section.
        flat_ends: close both ends with a flat cap.
    """
    rings = np.asarray(sections, float)
    around = np.linspace(-np.pi, np.pi, sides + 1)
    z, depth, width, shift = (rings[:, i : i + 1] for i in range(4))
    x, y = shift + depth * np.cos(around), width * np.sin(around)
    vertices = np.stack([x, y, np.broadcast_to(z, x.shape)], axis=-1)
    slope = -np.gradient(np.maximum(depth, width)[:, 0], z[:, 0])[:, None]
    normals = np.stack(
        [width * np.cos(around), depth * np.sin(around), np.broadcast_to(slope, x.shape)
         * np.sqrt(depth * width)], axis=-1,
    )  # fmt: skip
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9)
    v = (z - z[0]) / (z[-1] - z[0])
    uv = np.stack([np.broadcast_to(around / (2 * np.pi) + 0.5, x.shape),
                   np.broadcast_to(v, x.shape)], axis=-1)  # fmt: skip
    body = Mesh(
        vertices.reshape(-1, 3).astype(np.float32), normals.reshape(-1, 3).astype(np.float32),
        uv.reshape(-1, 2).astype(np.float32), _grid(len(rings), sides + 1),
    )  # fmt: skip
    if not flat_ends:
        return body
    return joined([body, _cap(vertices[0], -1.0), _cap(vertices[-1], 1.0)])


def cube(size_m: Sequence[float]) -> Mesh:
    """A box around the origin, so long, wide and high."""
    corner = np.asarray(size_m, float) / 2
    x, y, z = np.diag(2 * corner)
    sides = []
    for along, up in ((x, z), (z, y), (y, x)):
        sides.append(patch(-corner, along, up, (1, 1), (2, 2)))
        sides.append(patch(corner, -up, -along, (1, 1), (2, 2)))
    return joined(sides)


def _grid(rows: int, columns: int) -> NDArray[np.int32]:
    """Triangles between the points of a grid, counter-clockwise seen with rows going up."""
    corner = np.add.outer(np.arange(rows - 1) * columns, np.arange(columns - 1)).reshape(-1, 1)
    lower = np.array([0, 1, columns + 1])
    upper = np.array([0, columns + 1, columns])
    return np.concatenate([corner + lower, corner + upper]).astype(np.int32)


def _cap(ring: NDArray[np.float64], direction: float) -> Mesh:
    """A fan over a ring of (sides + 1, 3) points, facing up (1) or down (-1)."""
    vertices = np.vstack([ring, ring.mean(axis=0)])
    centre, corners = len(ring), np.arange(len(ring) - 1)
    pair = (corners, corners + 1) if direction > 0 else (corners + 1, corners)
    triangles = np.stack([*pair, np.full_like(corners, centre)], axis=1)
    normals = np.tile([0.0, 0.0, direction], (len(vertices), 1))
    middle = np.full((len(vertices), 2), 0.5, np.float32)
    return Mesh(
        vertices.astype(np.float32), normals.astype(np.float32), middle, triangles.astype(np.int32)
    )


def ellipsoid(radii_m: Sequence[float], rings: int = 8, sides: int = 12) -> Mesh:
    """An ellipsoid around the origin; half axes along x, y and z."""
    heights = np.sin(np.linspace(-np.pi / 2, np.pi / 2, rings + 1))
    girth = np.sqrt(np.maximum(1 - heights**2, 1e-6))
    sections = [(z * radii_m[2], g * radii_m[0], g * radii_m[1], 0.0)
                for z, g in zip(heights, girth, strict=True)]  # fmt: skip
    mesh = loft(sections, sides)
    normals = mesh.vertices / np.asarray(radii_m, np.float32) ** 2
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(mesh.vertices, normals.astype(np.float32), mesh.uv, mesh.triangles)


def node(name: str, mesh: Mesh, colour: Colour = (255, 255, 255)) -> Any:
    """A scene graph node with a mesh in one colour, which multiplies its texture."""
    columns = np.hstack([mesh.vertices, mesh.normals, mesh.uv]).astype(np.float32)
    kind = core.GeomVertexFormat.get_v3n3t2()
    data = core.GeomVertexData(name, kind, core.Geom.UH_static)
    data.unclean_set_num_rows(len(columns))
    data.modify_array_handle(0).copy_data_from(columns.tobytes())
    triangles = core.GeomTriangles(core.Geom.UH_static)
    triangles.set_index_type(core.Geom.NT_uint32)
    indices = triangles.modify_vertices()
    indices.unclean_set_num_rows(mesh.triangles.size)
    indices.modify_handle().copy_data_from(mesh.triangles.astype(np.uint32).tobytes())
    geometry = core.Geom(data)
    geometry.add_primitive(triangles)
    holder = core.GeomNode(name)
    holder.add_geom(geometry)
    path = core.NodePath(holder)
    path.set_color(*(channel / 255 for channel in colour), 1.0)
    return path
