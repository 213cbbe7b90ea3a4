"""Where a person's pixels have gone from one frame to the next: Median-Flow.

Z. Kalal, K. Mikolajczyk, J. Matas, "Forward-backward error: automatic detection of tracking
failures", ICPR 2010. Points on a grid in the box are followed forth and back; those that do not
come back to where they began are dropped, and the median of the rest moves and scales the box.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.base import BoxXyxy
from heel.services.geometry import boxes
from heel.services.geometry.picture_motion import Affine, moved_points

Floats = NDArray[np.float32]

_GRID = 10
"""Points to a side of the grid in a box."""
_WINDOW_PX = 11
"""Side of the patch that is followed."""
_PYRAMID_LEVELS = 3
"""Levels of the image pyramid; the camera's motion is known before."""
_REACH = 0.75
"""Pixels are looked at up to so many box heights around the box."""
_LEAST_POINTS = 12
"""That have to come back; chosen by hand."""
_FAILED = 0.06
"""Median forward-backward error and median residual of a flow that has failed, box heights."""
_LEAST_ERROR_PX = 1.0
"""Flow is no more precise, so that small boxes may fail by so much."""
_LARGEST_ZOOM = 1.15
"""From frame to frame; beyond, the flow is wrong."""
_PATCH_SIZE = (16, 32)
"""Columns and rows at which patches are compared."""


def followed(
    before: NDArray[np.uint8], now: NDArray[np.uint8], box: BoxXyxy, camera: Affine
) -> BoxXyxy | None:
    """The box one frame later, None where that cannot be told.

    Args:
        before: (H, W) uint8.
        now: (H, W) uint8, the next frame.
        box: in `before`.
        camera: motion of the camera between them, where the search begins.
    """
    width, height = boxes.width(box), boxes.height(box)
    points = _grid(box)
    guess = moved_points(camera, points.astype(np.float64)).astype(np.float32)
    low = np.minimum(points, guess).min(axis=0) - _REACH * height
    high = np.maximum(points, guess).max(axis=0) + _REACH * height
    rows, columns = before.shape
    x0, y0 = max(0, int(low[0])), max(0, int(low[1]))
    x1, y1 = min(columns, int(high[0]) + 1), min(rows, int(high[1]) + 1)
    if min(x1 - x0, y1 - y0) < 2 * _WINDOW_PX:
        return None
    origin = np.array([x0, y0], np.float32)
    flow = _flow(before[y0:y1, x0:x1], now[y0:y1, x0:x1], points - origin, guess - origin)
    if flow is None:
        return None
    start, end, error = flow[0] + origin, flow[1] + origin, flow[2]
    shift = np.median(end - start, axis=0)
    residual = float(np.median(np.linalg.norm(end - start - shift, axis=1)))
    if max(error, residual) > max(_LEAST_ERROR_PX, _FAILED * height):
        return None
    zoom = _zoom(start, end)
    if not 1.0 / _LARGEST_ZOOM < zoom < _LARGEST_ZOOM:
        return None
    x, y = boxes.centre(box)
    return boxes.around((x + float(shift[0]), y + float(shift[1])), zoom * width, zoom * height)


def _grid(box: BoxXyxy) -> Floats:
    """Points in the middle of a box, where the person is, (`_GRID`^2, 2)."""
    left, top, right, bottom = box
    x = np.linspace(left + 0.2 * (right - left), right - 0.2 * (right - left), _GRID)
    y = np.linspace(top + 0.1 * (bottom - top), bottom - 0.1 * (bottom - top), _GRID)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2).astype(np.float32)


def _flow(
    before: NDArray[np.uint8], now: NDArray[np.uint8], points: Floats, guess: Floats
) -> tuple[Floats, Floats, float] | None:
    """Starts, ends and median error of the better half of the points."""
    window = (_WINDOW_PX, _WINDOW_PX)
    forth, there, _ = cv2.calcOpticalFlowPyrLK(
        before, now, points[:, None], guess[:, None].copy(), winSize=window,
        maxLevel=_PYRAMID_LEVELS, flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )  # fmt: skip
    back, again, _ = cv2.calcOpticalFlowPyrLK(
        now, before, forth, points[:, None].copy(), winSize=window,
        maxLevel=_PYRAMID_LEVELS, flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )  # fmt: skip
    good = (np.asarray(there).ravel() == 1) & (np.asarray(again).ravel() == 1)
    if np.count_nonzero(good) < _LEAST_POINTS:
        return None
    start, end = points[good], np.asarray(forth, np.float32).reshape(-1, 2)[good]
    error = np.linalg.norm(np.asarray(back, np.float32).reshape(-1, 2)[good] - start, axis=1)
    middle = float(np.median(error))
    kept = error <= middle
    return start[kept], end[kept], middle


def _zoom(start: Floats, end: Floats) -> float:
    """Median ratio of the distances between points after and before."""
    first, second = np.triu_indices(len(start), 1)
    before = np.linalg.norm(start[first] - start[second], axis=1)
    after = np.linalg.norm(end[first] - end[second], axis=1)
    far = before > 1e-3
    return float(np.median(after[far] / before[far])) if far.any() else 1.0


def likeness(first: NDArray[np.uint8], second: NDArray[np.uint8]) -> float:
    """Normalised correlation in [-1, 1] of two results of `grey_patch`."""
    return float(cv2.matchTemplate(first, second, cv2.TM_CCOEFF_NORMED)[0, 0])


def grey_patch(image: NDArray[np.uint8], box: BoxXyxy) -> NDArray[np.uint8]:
    """Pixels of (H, W) uint8 under a box, at one size for all; outside, the edge is repeated."""
    size = (max(2, round(boxes.width(box))), max(2, round(boxes.height(box))))
    patch = cv2.getRectSubPix(image, size, boxes.centre(box))
    return np.asarray(cv2.resize(patch, _PATCH_SIZE, interpolation=cv2.INTER_AREA), np.uint8)
