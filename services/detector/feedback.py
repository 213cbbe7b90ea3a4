"""Tracks that come back: which ones go with a frame, and where they say that people stand."""

from __future__ import annotations

from collections import OrderedDict

import numpy as np
from numpy.typing import NDArray

from heel.schemas import FrameId, Track, Tracks
from heel.services.detector.scene import WorkSize
from heel.services.geometry.picture_motion import Affine, moved_points

_KEPT_FRAMES = 64  # more than the largest lag
_MARGIN_SIDE = 0.25  # of a protected box, widths: arms swing beyond it; chosen by hand
_MARGIN_ABOVE = 0.08  # heights: hair reaches beyond the box; chosen by hand
_MARGIN_BELOW = 0.06  # heights: feet reach beyond the box; chosen by hand


class FeedbackBuffer:
    """Recent tracks by frame, of the newest epoch only."""

    def __init__(self, lag_frames: int) -> None:
        self._lag = lag_frames
        self._epoch: int | None = None
        self._tracks: OrderedDict[int, Tracks] = OrderedDict()

    def add(self, tracks: Tracks) -> None:
        """Keep the tracks of one frame."""
        if tracks.epoch != self._epoch:
            self._epoch = tracks.epoch
            self._tracks.clear()
        self._tracks[tracks.seq] = tracks
        while len(self._tracks) > _KEPT_FRAMES:
            self._tracks.popitem(last=False)

    def exact(self, frame: FrameId) -> Tracks | None:
        """The tracks of exactly `lag` frames before, if they are here."""
        if frame.epoch != self._epoch:
            return None
        return self._tracks.get(frame.seq - self._lag)

    def newest(self, frame: FrameId) -> Tracks | None:
        """The newest tracks at least `lag` frames old: all that a live stream can promise."""
        if frame.epoch != self._epoch:
            return None
        seqs = [seq for seq in self._tracks if seq <= frame.seq - self._lag]
        return self._tracks[max(seqs)] if seqs else None


def free_mask(
    tracks: Tracks | None, frame: FrameId | None, size: WorkSize, camera: Affine | None = None
) -> NDArray[np.uint8]:
    """(size.height, size.width) uint8: 0 under confirmed people and close by, else 255.

    Args:
        tracks: moved to the time of `frame` by their velocity; None for nobody.
        frame: the frame that is to be protected.
        size: the working size.
        camera: motion of the camera from the tracks' frame to `frame`, working pixels; None if
            it stood still.
    """
    free = np.full((size.height, size.width), 255, np.uint8)
    if tracks is not None and frame is not None:
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
    """Rows and columns under a box with its margin."""
    left, top, right, bottom = track.box_xyxy
    shift_x, shift_y = (elapsed_s * velocity for velocity in track.velocity_pxps)
    across, down = right - left, bottom - top
    corners = np.array(
        [
            [left + shift_x - _MARGIN_SIDE * across, top + shift_y - _MARGIN_ABOVE * down],
            [right + shift_x + _MARGIN_SIDE * across, bottom + shift_y + _MARGIN_BELOW * down],
        ]
    ) / (size.scale_x, size.scale_y)
    if camera is not None:
        corners = moved_points(camera, corners)
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    return _between(y0, y1), _between(x0, x1)


def _between(first: float, last: float) -> slice:
    return slice(max(0, int(first)), max(0, int(last) + 1))
