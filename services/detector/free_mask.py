"""Where no confirmed person stands: what the background may learn and motion may be judged by."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heel.schemas import FrameId, Track, Tracks
from heel.services.detector.camera_motion import Affine
from heel.services.detector.geometry import WorkSize

_SIDE, _ABOVE, _BELOW = 0.25, 0.08, 0.06


def free_mask(
    tracks: Tracks | None, frame: FrameId, size: WorkSize, camera: Affine | None = None
) -> NDArray[np.uint8]:
    """(size.height, size.width) uint8: 0 under confirmed people and close by, else 255.

    Args:
        tracks: moved to the time of `frame` by their velocity.
        frame: the frame that is to be protected.
        size: the working size.
        camera: motion of the camera from the tracks' frame to `frame`, working pixels; None if
            it stood still.
    """
    free = np.full((size.height, size.width), 255, np.uint8)
    if tracks is not None:
        elapsed_s = shift_s(tracks, frame)
        for track in tracks.tracks:
            if track.state != "new":
                free[_covered(track, elapsed_s, size, camera)] = 0
    return free


def shift_s(tracks: Tracks, frame: FrameId) -> float:
    """Seconds from the tracks' frame to another."""
    return (frame.t_capture_ns - tracks.t_capture_ns) * 1e-9


def _covered(
    track: Track, elapsed_s: float, size: WorkSize, camera: Affine | None
) -> tuple[slice, slice]:
    """Rows and columns under a box with a margin: feet and hair reach beyond it, arms swing."""
    left, top, right, bottom = track.box_xyxy
    shift_x, shift_y = (elapsed_s * velocity for velocity in track.velocity_pxps)
    across, down = right - left, bottom - top
    corners = np.array(
        [
            [left + shift_x - _SIDE * across, top + shift_y - _ABOVE * down],
            [right + shift_x + _SIDE * across, bottom + shift_y + _BELOW * down],
        ]
    ) / (size.scale_x, size.scale_y)
    if camera is not None:
        corners = corners @ camera[:, :2].T + camera[:, 2]
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    return _between(y0, y1), _between(x0, x1)


def _between(first: float, last: float) -> slice:
    return slice(max(0, int(first)), max(0, int(last) + 1))
