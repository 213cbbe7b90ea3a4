"""What a camera could see of people: boxes, and which parts of them are hidden by what."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.services.geometry.camera import GroundCamera, Pinhole
from heel.services.simulator.solids import Solids, cast_at_discs
from heel.services.simulator.state import CameraMount, RobotState, WorldView

Array = NDArray[np.float64]

COLUMNS = 5
"""Cells across a box, in which a person is looked for; chosen by hand: a fifth of a body."""
ROWS = 9
"""Cells down a box; likewise, about square."""
NEAR_M = 0.25
"""What is nearer than this to the camera has no box."""
_STEP_PER_HEIGHT = 0.16
"""What the legs of a person in full stride seen from the side add to the width."""
_STRIDES_FROM = 0.95
"""A person that is not upright makes no steps."""
_BODY_RADIUS_M = 0.2
"""Of what a body hides; arms and gaps let more through than the body as a disc does."""
_ACROSS = (np.arange(COLUMNS) + 0.5) / COLUMNS - 0.5
"""Middle of each column, from the middle of the box, share of its width."""
_DOWN = (np.arange(ROWS) + 0.5) / ROWS
"""Middle of each row, share of the box's height."""


@dataclass(frozen=True, slots=True)
class Sight:
    """All people as seen from the robot, in the order of `WorldView.people`.

    Attributes:
        box_xyxy: (N, 4) pixels, unclipped and unoccluded; 0 where not `in_front`.
        depth_m: (N,) along the optical axis.
        in_front: (N,) whether there is a box.
        in_picture: (N, ROWS, COLUMNS) cells of the box within the picture.
        hidden_by: (N, ROWS, COLUMNS) what hides a cell: -1 nothing, 0 to N - 1 a person, from N
            on an obstacle.
        visible: (N,) share of cells that are in the picture and not hidden.
    """

    box_xyxy: Array
    depth_m: Array
    in_front: NDArray[np.bool_]
    in_picture: NDArray[np.bool_]
    hidden_by: NDArray[np.intp]
    visible: Array


def lens(mount: CameraMount) -> GroundCamera:
    """The camera's geometry."""
    pinhole = Pinhole.from_fov(mount.width_px, mount.height_px, mount.horizontal_fov_rad)
    return pinhole.mounted(mount.height_m, mount.pitch_rad)


def look(world: WorldView, solids: Solids, mount: CameraMount) -> Sight:
    """See all people from where the robot is now; `solids` are the world's obstacles."""
    people, robot = world.people, world.robot
    table = np.array(
        [
            (
                p.x_m,
                p.y_m,
                p.heading_rad,
                p.speed_mps,
                p.stride_rad,
                p.tall * p.height_m,
                p.wide * p.height_m,
                p.height_m * (p.tall > _STRIDES_FROM),
            )
            for p in people
        ]
    ).reshape(-1, 8)
    ground = to_robot(table[:, :2], robot)
    camera = lens(mount)
    box, depth = _boxes(camera, ground, table, robot.heading_rad)
    in_front = (depth > NEAR_M) & np.isfinite(box).all(1)
    box[~in_front] = 0.0
    in_picture = _in_picture(box, mount) & in_front[:, None, None]
    hidden_by = np.full(in_picture.shape, -1, np.intp)
    rows = np.flatnonzero(in_picture.any((1, 2)))
    if rows.size:
        hidden_by[rows] = _hidden(world, solids, camera, table, rows, box, depth)
    visible = ((hidden_by < 0) & in_picture).mean((1, 2))
    return Sight(box, depth, in_front, in_picture, hidden_by, visible)


def to_robot(place: Array, robot: RobotState) -> Array:
    """Places (N, 2) of the world as x ahead and y left of the robot."""
    cosine, sine = math.cos(robot.heading_rad), math.sin(robot.heading_rad)
    offset = place - (robot.x_m, robot.y_m)
    return np.stack(
        [cosine * offset[:, 0] + sine * offset[:, 1], cosine * offset[:, 1] - sine * offset[:, 0]],
        axis=-1,
    )


def _boxes(
    camera: GroundCamera, ground: Array, table: Array, robot_heading_rad: float
) -> tuple[Array, Array]:
    """Boxes (N, 4) and depths (N,) of half their height."""
    height = table[:, 5]
    view = np.arctan2(ground[:, 1], ground[:, 0]) + robot_heading_rad
    swing = np.abs(np.sin(table[:, 4])) * np.minimum(table[:, 3], 1.0)
    sideways = np.abs(np.sin(table[:, 2] - view))
    width = table[:, 6] + table[:, 7] * _STEP_PER_HEIGHT * swing * sideways
    below = camera.mount_height_m - height / 2
    depth = ground[:, 0] * math.cos(camera.pitch_rad) + below * math.sin(camera.pitch_rad)
    with np.errstate(divide="ignore", invalid="ignore"):
        return camera.person_boxes(ground, height, width), depth


def _in_picture(box: Array, mount: CameraMount) -> NDArray[np.bool_]:
    left, top, right, bottom = (box[:, side, None] for side in range(4))
    x_px = (left + right) / 2 + (right - left) * _ACROSS
    y_px = top + (bottom - top) * _DOWN
    across = (x_px >= 0) & (x_px < mount.width_px)
    down = (y_px >= 0) & (y_px < mount.height_px)
    return np.asarray(down[:, :, None] & across[:, None, :])


def _hidden(
    world: WorldView, solids: Solids, camera: GroundCamera, table: Array,
    rows: NDArray[np.intp], box: Array, depth: Array,
) -> NDArray[np.intp]:  # fmt: skip
    """What hides each cell of some people (K, ROWS, COLUMNS); `rows` (K,) says of whom."""
    count, place = len(rows), table[:, :2]
    height = table[rows, 5]
    origin = np.array([world.robot.x_m, world.robot.y_m])
    ray = place[rows] - origin
    # Cells across the box at the person's own distance, at right angles to the line of sight.
    width_m = (box[rows, 2] - box[rows, 0]) / camera.focal_px * depth[rows]
    away_m = np.maximum(np.sqrt((ray * ray).sum(1)), 1e-6)
    aside = np.stack([ray[:, 1], -ray[:, 0]], -1) * (width_m / away_m)[:, None]
    rays = (ray[:, None] + aside[:, None] * _ACROSS[:, None]).reshape(-1, 2)
    discs = cast_at_discs(origin, rays, place, np.full(len(place), _BODY_RADIUS_M))
    discs[np.arange(count * COLUMNS), np.repeat(rows, COLUMNS)] = np.inf
    entry_solid, leave_solid = solids.cast(origin, rays)
    entry = np.hstack([discs, entry_solid])
    between = np.flatnonzero((entry < 1.0).any(0))
    if not between.size:
        return np.full((count, ROWS, COLUMNS), -1, np.intp)
    entry = entry[:, between].reshape(count, 1, COLUMNS, -1)
    leave = np.hstack([discs, leave_solid])[:, between].reshape(count, 1, COLUMNS, -1)
    tall = np.append(table[:, 5], solids.height_m)[between]
    # Along a line of sight from the lens to a cell heights change linearly: it passes over what
    # is lower than both its ends above it.
    rise = (height[:, None] * (1.0 - _DOWN) - camera.mount_height_m)[:, :, None, None]
    lowest = camera.mount_height_m + np.minimum(rise * entry, rise * np.minimum(leave, 1.0))
    covers = (entry < 1.0) & (lowest < tall)
    nearest = np.where(covers, entry, np.inf).argmin(-1)
    return np.where(covers.any(-1), between[nearest], -1)
