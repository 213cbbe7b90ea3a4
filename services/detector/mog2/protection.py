"""Where confirmed people stand, so that they are not learned into the background.

PETS09-S2L1 with and without: MOTA 68 and 63, IDF1 76 and 64. Unconfirmed tracks are never
protected: a ghost, left where somebody walked away, would become permanent. For the same reason
protection ends for a track that never leaves its spot.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Track, Tracks
from heel.schemas.base import Point
from heel.services.detector.geometry import WorkSize

SPOT_RADIUS = 0.3
"""Farthest a standing person's box wanders, heights."""

MAX_AHEAD_S = 1.0
"""Tracks are not moved ahead further than this: older feedback is a guess."""


class Protection:
    """Remembers where each person last stood still, and protects those who move now and then."""

    def __init__(self, size: WorkSize, margin: float, max_still_s: float) -> None:
        """Know nobody.

        Args:
            size: the working size.
            margin: growth of each box per side, share of its size.
            max_still_s: a track that stays on one spot for longer is no longer protected.
        """
        self._size = size
        self._margin = margin
        self._max_still_s = max_still_s
        self._spots: dict[int, tuple[Point, int]] = {}

    def mask(self, feedback: Tracks, t_capture_ns: int) -> NDArray[np.bool_]:
        """Working pixels under the people of `feedback`, moved ahead by their velocity.

        Args:
            feedback: tracks of an earlier frame of the same size.
            t_capture_ns: acquisition time of the frame to protect.

        Returns:
            (size.height, size.width) bool, true where nothing may be learned.
        """
        mask = np.zeros((self._size.height, self._size.width), np.bool_)
        ahead_s = min(MAX_AHEAD_S, max(0.0, (t_capture_ns - feedback.t_capture_ns) / 1e9))
        self._spots = {track.id: self._spot(track, t_capture_ns) for track in feedback.tracks}
        for track in feedback.tracks:
            still_s = (t_capture_ns - self._spots[track.id][1]) / 1e9
            seen = track.shown and track.state in ("tracked", "occluded")
            if seen and still_s <= self._max_still_s:
                rows, columns = _covered(track, ahead_s, self._size, self._margin)
                mask[rows, columns] = True
        return mask

    def _spot(self, track: Track, now_ns: int) -> tuple[Point, int]:
        """The spot the track stays on and since when, new when it has left the old one."""
        left, top, right, bottom = track.box_xyxy
        foot = ((left + right) / 2, bottom)
        spot, since_ns = self._spots.get(track.id, (foot, now_ns))
        left_it = math.dist(foot, spot) > SPOT_RADIUS * (bottom - top)
        return (foot, now_ns) if left_it else (spot, since_ns)


def _covered(track: Track, ahead_s: float, size: WorkSize, margin: float) -> tuple[slice, slice]:
    left, top, right, bottom = track.box_xyxy
    velocity_x, velocity_y = track.velocity_pxps
    grow_x, grow_y = margin * (right - left), margin * (bottom - top)
    shift_x, shift_y = velocity_x * ahead_s, velocity_y * ahead_s
    columns = np.clip(
        [(left + shift_x - grow_x) / size.scale_x, (right + shift_x + grow_x) / size.scale_x],
        0,
        size.width,
    )
    rows = np.clip(
        [(top + shift_y - grow_y) / size.scale_y, (bottom + shift_y + grow_y) / size.scale_y],
        0,
        size.height,
    )
    return (
        slice(int(rows[0]), int(np.ceil(rows[1]))),
        slice(int(columns[0]), int(np.ceil(columns[1]))),
    )
