"""Obstacles as arrays: what rays hit, and where discs come to rest against them.

Everything that stands in the world is an upright box, so both questions are asked in plan, each
box in its own axes; heights only matter to a view over it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heel.services.simulator.state import Obstacle

Array = NDArray[np.float64]
_TINY = 1e-12
"""Below it a length is zero: a guard against division."""


class Solids:
    """The boxes of a scenery, ready for many points at once.

    Args:
        obstacles: M of them, M may be 0.
    """

    def __init__(self, obstacles: tuple[Obstacle, ...]) -> None:
        rows = [
            (o.x_m, o.y_m, o.heading_rad, o.length_m / 2, o.width_m / 2, o.height_m)
            for o in obstacles
        ]
        table = np.array(rows, np.float64).reshape(-1, 6)
        self.height_m: Array = table[:, 5]
        self._centre = table[:, :2]
        self._half = table[:, 3:5]
        cosine, sine = np.cos(table[:, 2]), np.sin(table[:, 2])
        # Rows are the axes of each box: world to box is `axes @ vector`.
        self._axes = np.stack([np.stack([cosine, sine], -1), np.stack([-sine, cosine], -1)], -2)
        self._reach = np.hypot(self._half[:, 0], self._half[:, 1])

    def __len__(self) -> int:
        return len(self.height_m)

    def clearance(self, points: Array) -> tuple[Array, Array]:
        """How far points are from each box, and which way is out.

        Args:
            points: (N, 2) metres.

        Returns:
            Distances (N, M) in metres, negative inside, and unit vectors (N, M, 2) away from
            the box.
        """
        local = np.einsum("mij,nmj->nmi", self._axes, points[:, None] - self._centre)
        beyond = np.abs(local) - self._half
        outside = np.maximum(beyond, 0.0)
        distance = np.sqrt(outside[..., 0] ** 2 + outside[..., 1] ** 2)
        inside = distance <= 0.0
        if inside.any():
            # The way out is through the nearest face.
            first = beyond[..., 0] >= beyond[..., 1]
            out = np.stack([first, ~first], -1).astype(np.float64)
            outside = np.where(inside[..., None], out, outside)
            distance = np.where(inside, beyond.max(-1), distance)
        away = np.where(local < 0.0, -outside, outside)
        length = np.sqrt(away[..., 0] ** 2 + away[..., 1] ** 2)
        away = away / np.maximum(length, _TINY)[..., None]
        return distance, np.einsum("mji,nmj->nmi", self._axes, away)

    def push_out(self, points: Array, radius_m: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Where discs come to rest that have been moved into boxes.

        Args:
            points: (N, 2) metres.
            radius_m: (N,).

        Returns:
            The points (N, 2), moved out of every box by the shortest way, and whether each had
            to be (N,).
        """
        touched = np.zeros(len(points), np.bool_)
        if not len(self):
            return points, touched
        rows = np.arange(len(points))
        # A disc in a corner is pushed from one wall into the other: three rounds settle it.
        for _ in range(3):
            distance, away = self.clearance(points)
            nearest = distance.argmin(1)
            depth = radius_m - distance[rows, nearest]
            hit = depth > _TINY
            if not hit.any():
                break
            touched |= hit
            points = points + np.where(hit, depth, 0.0)[:, None] * away[rows, nearest]
        return points, touched

    def cast(self, origin: Array, rays: Array) -> tuple[Array, Array]:
        """Where rays enter and leave each box, in plan.

        The slab method (Kay and Kajiya 1986) in the axes of each box.

        Args:
            origin: (2,) metres.
            rays: (R, 2) vectors of any length above 0.

        Returns:
            Entry and exit (R, M) in units of the ray; a ray that misses enters at infinity. One
            that starts inside enters at 0.
        """
        start = np.einsum("mij,mj->mi", self._axes, origin - self._centre)
        along = np.einsum("mij,rj->rmi", self._axes, rays)
        along = np.where(np.abs(along) < _TINY, _TINY, along)
        near = (-np.sign(along) * self._half - start) / along
        far = (np.sign(along) * self._half - start) / along
        entry = np.maximum(near.max(-1), 0.0)
        leave = far.min(-1)
        return np.where(entry <= leave, entry, np.inf), leave


def cast_at_discs(origin: Array, rays: Array, centre: Array, radius_m: Array) -> Array:
    """Where rays enter discs, in plan.

    Args:
        origin: (2,) metres.
        rays: (R, 2) vectors of any length above 0.
        centre: (N, 2) metres.
        radius_m: (N,).

    Returns:
        (R, N) in units of the ray; infinity where it misses, 0 where it starts inside.
    """
    offset = centre - origin
    squared = np.einsum("ri,ri->r", rays, rays)[:, None]
    along = rays @ offset.T
    inside = radius_m**2 - np.einsum("ni,ni->n", offset, offset)
    under_root = along**2 + squared * inside
    root = np.sqrt(np.maximum(under_root, 0.0))
    hit = (under_root >= 0.0) & (along + root >= 0.0)
    return np.where(hit, np.maximum(along - root, 0.0) / squared, np.inf)
