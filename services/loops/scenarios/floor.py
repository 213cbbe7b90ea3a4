"""The shortest way on the floor between two places, around what stands there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import shortest_path

from heel.services.simulator.state import Obstacle

Reals = NDArray[np.float64]
_MARGIN_M = 1e-3
"""Points this near to a corner are beyond it, whatever rounding does."""


class Floor:
    """Obstacles as a visibility graph of their corners.

    The shortest way among polygons bends at corners only (Lozano-Perez and Wesley 1979). A point
    moves here, as in Habitat's geodesic distance between the robot's and the person's positions;
    bodies are not grown.

    Args:
        obstacles: upright boxes.
    """

    def __init__(self, obstacles: tuple[Obstacle, ...]) -> None:
        self._centre = np.array([[o.x_m, o.y_m] for o in obstacles]).reshape(-1, 2)
        self._half = np.array([[o.length_m, o.width_m] for o in obstacles]).reshape(-1, 2) / 2
        heading = np.array([o.heading_rad for o in obstacles])
        ahead = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
        self._axes = np.stack([ahead, left], axis=1)
        self._corners = self._free_corners()
        self._between = self._corner_paths()

    def path_m(self, start: Reals, end: Reals) -> Reals:
        """Length of the shortest way, m; the straight line where no way leads around.

        Args:
            start: (N, 2) metres.
            end: (N, 2) metres.

        Returns:
            (N,).
        """
        lengths: Reals = np.linalg.norm(end - start, axis=1)
        for index in np.flatnonzero(self._blocked(start, end)):
            around = self._around(start[index], end[index])
            if np.isfinite(around):
                lengths[index] = around
        return lengths

    def _around(self, start: Reals, end: Reals) -> float:
        if not len(self._corners):
            return np.inf
        out = self._legs(start)
        back = self._legs(end)
        return float(np.min(out[:, None] + self._between + back))

    def _legs(self, point: Reals) -> Reals:
        """(K,) length from a point to each corner, infinite where it cannot be seen from there."""
        points = np.broadcast_to(point, self._corners.shape)
        lengths: Reals = np.linalg.norm(self._corners - point, axis=1)
        lengths[self._blocked(points, self._corners)] = np.inf
        return lengths

    def _free_corners(self) -> Reals:
        """(K, 2) corners, a hair outside their own box, that lie in no other box."""
        signs = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
        reach = signs * (self._half + _MARGIN_M)[:, None]
        corners = (self._centre[:, None] + np.einsum("mki,mij->mkj", reach, self._axes)).reshape(
            -1, 2
        )
        local = np.einsum("mij,kmj->kmi", self._axes, corners[:, None] - self._centre)
        inside = (np.abs(local) < self._half).all(axis=2).any(axis=1)
        return np.asarray(corners[~inside], np.float64)

    def _corner_paths(self) -> Reals:
        count = len(self._corners)
        if not count:
            return np.zeros((0, 0))
        lengths = np.stack([self._legs(corner) for corner in self._corners])
        paths = shortest_path(np.where(np.isfinite(lengths), lengths, 0.0), directed=False)
        return np.asarray(paths, np.float64)

    def _blocked(self, start: Reals, end: Reals) -> NDArray[np.bool_]:
        """(N,) whether the straight line passes through the inside of a box (slab method)."""
        if not len(self._centre):
            return np.zeros(len(start), np.bool_)
        origin = np.einsum("mij,nmj->nmi", self._axes, start[:, None] - self._centre)
        along = np.einsum("mij,nj->nmi", self._axes, end - start)
        along = np.where(np.abs(along) < 1e-12, 1e-12, along)
        near = (-np.sign(along) * self._half - origin) / along
        far = (np.sign(along) * self._half - origin) / along
        entry = np.maximum(near.max(axis=2), 0.0)
        leave = np.minimum(far.min(axis=2), 1.0)
        return np.asarray((leave - entry > 1e-9).any(axis=1))
