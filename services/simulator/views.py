"""What a camera could see of everybody: boxes, and which parts of them are hidden by what."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.simulator.solids import Solids, cast_at_discs
from services.simulator.state import CameraMount, WorldView

Array = NDArray[np.float64]

COLUMNS, ROWS = 5, 9
"""Cells of a box in which somebody is looked for."""
NEAR_M = 0.25
"""What is nearer than this to the camera has no box."""
_WIDTH_PER_HEIGHT = 0.28
_STEP_PER_HEIGHT = 0.16
"""What the legs of somebody in full stride seen from the side add to the width."""
_BODY_RADIUS_M = 0.2
"""Of what a body hides; arms and gaps let more through than the body as a disc does."""
_ACROSS = (np.arange(COLUMNS) + 0.5) / COLUMNS - 0.5
_DOWN = (np.arange(ROWS) + 0.5) / ROWS


@dataclass(frozen=True, slots=True)
class Sight:
    """Everybody as seen from the robot, in the order of `WorldView.people`.

    Attributes:
        box_xyxy: (N, 4) pixels, unclipped and unoccluded; nonsense where not `in_front`.
        depth_m: (N,) along the optical axis.
        in_front: (N,) whether there is a box.
        shown: (N, ROWS, COLUMNS) cells of the box that are in the picture and not hidden.
        hidden_by: (N, ROWS, COLUMNS) what hides a cell: -1 nothing, 0 to N - 1 a person, from N
            on an obstacle.
        visible: (N,) share of cells shown.
    """

    box_xyxy: Array
    depth_m: Array
    in_front: NDArray[np.bool_]
    shown: NDArray[np.bool_]
    hidden_by: NDArray[np.intp]
    visible: Array


class Pinhole:
    """Projects places around the robot into the picture of its camera."""

    def __init__(self, mount: CameraMount) -> None:
        self.focal_px = mount.width_px / 2 / math.tan(mount.horizontal_fov_rad / 2)
        self._centre = mount.width_px / 2, mount.height_px / 2
        self._height_m = mount.height_m
        self._cosine, self._sine = math.cos(mount.pitch_rad), math.sin(mount.pitch_rad)

    def project(
        self, ahead_m: Array, left_m: Array, up_m: Array | float
    ) -> tuple[Array, Array, Array]:
        """Pixels x and y, and the depth; places are relative to the robot's centre on the floor."""
        rise = up_m - self._height_m
        depth = ahead_m * self._cosine - rise * self._sine
        down = -ahead_m * self._sine - rise * self._cosine
        scale = self.focal_px / np.maximum(depth, 1e-3)
        return self._centre[0] - scale * left_m, self._centre[1] + scale * down, depth


def look(world: WorldView, solids: Solids, mount: CameraMount) -> Sight:
    """See everybody from where the robot is now; `solids` are the world's obstacles."""
    people, robot = world.people, world.robot
    table = np.array(
        [(p.x_m, p.y_m, p.heading_rad, p.speed_mps, p.stride_rad, p.height_m) for p in people]
    ).reshape(-1, 6)
    cosine, sine = math.cos(robot.heading_rad), math.sin(robot.heading_rad)
    x_m, y_m = table[:, 0] - robot.x_m, table[:, 1] - robot.y_m
    ahead, left = cosine * x_m + sine * y_m, cosine * y_m - sine * x_m
    height = table[:, 5]
    box, depth = _boxes(Pinhole(mount), ahead, left, height, table, robot.heading_rad)
    in_front = depth > NEAR_M
    hidden_by = _hidden(world, solids, mount, table[:, :2], height, box, depth)
    shown = (hidden_by < 0) & _in_picture(box, mount) & in_front[:, None, None]
    return Sight(box, depth, in_front, shown, hidden_by, shown.mean((1, 2)))


def _boxes(
    camera: Pinhole, ahead: Array, left: Array, height: Array, table: Array, robot_heading: float
) -> tuple[Array, Array]:
    """Boxes (N, 4) and depths (N,)."""
    x_px, top, _ = camera.project(ahead, left, height)
    _, bottom, _ = camera.project(ahead, left, 0.0)
    _, _, depth = camera.project(ahead, left, height / 2)
    view = np.arctan2(left, ahead) + robot_heading
    swing = np.abs(np.sin(table[:, 4])) * np.minimum(table[:, 3], 1.0)
    sideways = np.abs(np.sin(table[:, 2] - view))
    width = height * (_WIDTH_PER_HEIGHT + _STEP_PER_HEIGHT * swing * sideways)
    half = camera.focal_px * width / 2 / np.maximum(depth, NEAR_M)
    return np.stack([x_px - half, top, x_px + half, bottom], -1), depth


def _in_picture(box: Array, mount: CameraMount) -> NDArray[np.bool_]:
    left, top, right, bottom = (box[:, side, None] for side in range(4))
    x_px = (left + right) / 2 + (right - left) * _ACROSS
    y_px = top + (bottom - top) * _DOWN
    across = (x_px >= 0) & (x_px < mount.width_px)
    down = (y_px >= 0) & (y_px < mount.height_px)
    return np.asarray(down[:, :, None] & across[:, None, :])


def _hidden(
    world: WorldView,
    solids: Solids,
    mount: CameraMount,
    place: Array,
    height: Array,
    box: Array,
    depth: Array,
) -> NDArray[np.intp]:
    """What hides each cell (N, ROWS, COLUMNS)."""
    count = len(place)
    origin = np.array([world.robot.x_m, world.robot.y_m])
    ray = place - origin
    # Cells across the box at the person's own distance, at right angles to the line of sight.
    width_m = (box[:, 2] - box[:, 0]) / Pinhole(mount).focal_px * np.maximum(depth, NEAR_M)
    away_m = np.maximum(np.sqrt((ray * ray).sum(1)), 1e-6)
    aside = np.stack([ray[:, 1], -ray[:, 0]], -1) * (width_m / away_m)[:, None]
    rays = (ray[:, None] + aside[:, None] * _ACROSS[:, None]).reshape(-1, 2)
    discs = cast_at_discs(origin, rays, place, np.full(count, _BODY_RADIUS_M))
    own = np.arange(count * COLUMNS)
    discs[own, own // COLUMNS] = np.inf
    entry_solid, leave_solid = solids.cast(origin, rays)
    entry = np.hstack([discs, entry_solid])
    between = np.flatnonzero((entry < 1.0).any(0))
    hidden_by = np.full((count, ROWS, COLUMNS), -1, np.intp)
    if not between.size:
        return hidden_by
    entry = entry[:, between].reshape(count, 1, COLUMNS, -1)
    leave = np.hstack([discs, leave_solid])[:, between].reshape(count, 1, COLUMNS, -1)
    tall = np.append(height, solids.height_m)[between]
    # Along a line of sight from the lens to a cell heights change linearly: it passes over what
    # is lower than both its ends above it.
    rise = (height[:, None] * (1.0 - _DOWN) - mount.height_m)[:, :, None, None]
    lowest = mount.height_m + np.minimum(rise * entry, rise * np.minimum(leave, 1.0))
    covers = (entry < 1.0) & (lowest < tall)
    nearest = np.where(covers, entry, np.inf).argmin(-1)
    return np.where(covers.any(-1), between[nearest], hidden_by)
