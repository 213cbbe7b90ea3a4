"""Boxes as the association modules need them: as measurements, and which box may hide which.

Every function is pure and works on float arrays of `xyxy` pixel boxes, origin top-left.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heel.services.geometry.boxes import cover_matrix

FloatArray = NDArray[np.float64]

AXES = 4
"""Axes of a measurement: centre x, centre y, ln height, ln aspect ratio (width / height)."""


def boxes_to_measurements(boxes: FloatArray) -> FloatArray:
    """Turn (N, 4) xyxy pixel boxes into (N, 4) rows of centre x, centre y, ln height, ln aspect.

    Height and aspect ratio are a one-to-one change of variables from the paper's area `A = w h`
    and span `s = sqrt(w^2 + h^2)`. Unlike those two their errors are nearly independent, and in
    logarithms they are the same for near and far people.
    """
    width = boxes[:, 2] - boxes[:, 0]
    height = boxes[:, 3] - boxes[:, 1]
    return np.stack(
        [
            (boxes[:, 0] + boxes[:, 2]) / 2,
            (boxes[:, 1] + boxes[:, 3]) / 2,
            np.log(height),
            np.log(width / height),
        ],
        axis=1,
    )


def measurements_to_boxes(measurements: FloatArray) -> FloatArray:
    """Inverse of `boxes_to_measurements`: (N, 4) rows back to (N, 4) xyxy pixel boxes."""
    half_height = np.exp(measurements[:, 2]) / 2
    half_width = half_height * np.exp(measurements[:, 3])
    centre_x, centre_y = measurements[:, 0], measurements[:, 1]
    return np.stack(
        [
            centre_x - half_width,
            centre_y - half_height,
            centre_x + half_width,
            centre_y + half_height,
        ],
        axis=1,
    )


def covered_by(boxes: FloatArray) -> FloatArray:
    """Share (N, N) in [0, 1] of each of (N, 4) boxes that each other box hides if it is nearer.

    Nearer means a lower foot line (larger bottom y), as on a common ground plane.
    """
    nearer = boxes[None, :, 3] > boxes[:, None, 3]
    return np.where(nearer, cover_matrix(boxes, boxes), 0.0)


def crowding(boxes: FloatArray) -> FloatArray:
    """Share in [0, 1] of each of (N, 4) boxes that the box it overlaps most has in common."""
    if len(boxes) < 2:
        return np.zeros(len(boxes))
    shared = cover_matrix(boxes, boxes)
    np.fill_diagonal(shared, 0.0)
    return np.asarray(shared.max(axis=1))
