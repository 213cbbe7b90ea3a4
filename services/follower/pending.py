"""A point that a user pointed at and that has no track yet."""

from __future__ import annotations

import math

from heel.schemas import Track, Tracks
from heel.schemas.base import Point
from heel.services.follower.choosing import at_point

PENDING_S = 5.0
"""How long a person is looked for. Chosen by hand: detectors need half a second or two, and after
more than that a user has forgotten where they clicked."""
_WALK_HEIGHTS_PER_S = 0.6
"""A person that walks at 1 m/s, in own heights: so far from the point it may be."""
_WALK_S = 0.5
"""And no longer: a person that appears far from the point is another one."""
_OUT_OF_REACH = 3.0
"""Frame sizes off the picture, from where no point is carried back."""


class CarriedPoint:
    """A point of the scene, which goes along with the picture while the camera turns.

    Attributes:
        place_px: where it is in the newest frame.
    """

    def __init__(self, place_px: Point, tracks: Tracks) -> None:
        """Look at a point of the newest frame."""
        self.place_px = place_px
        self._seq = tracks.seq

    def carry(self, tracks: Tracks, turned_rad: float, focal_px: float) -> None:
        """Follow the picture to the next frame.

        Args:
            tracks: of that frame. What it tells of the camera counts if no frame was left out.
            turned_rad: how far the robot has turned to the left since the frame before.
            focal_px: of the camera.
        """
        if tracks.seq == self._seq:
            return
        motion, (x, y) = tracks.camera_motion, self.place_px
        if motion is not None and motion.quality > 0.0 and tracks.seq == self._seq + 1:
            a, b, c, d, e, f = motion.affine
            x, y = a * x + b * y + c, d * x + e * y + f
        else:
            middle = tracks.width / 2
            seen_rad = math.atan2(x - middle, focal_px) + turned_rad
            # Behind the camera nothing is seen; just short of that the tangent is huge but finite.
            x = middle + focal_px * math.tan(min(max(seen_rad, -1.5), 1.5))
        self._seq = tracks.seq
        reach_x, reach_y = _OUT_OF_REACH * tracks.width, _OUT_OF_REACH * tracks.height
        self.place_px = min(max(x, -reach_x), reach_x), min(max(y, -reach_y), reach_y)


class PendingPoint(CarriedPoint):
    """Goes along with what was pointed at until a track covers it, or for too long.

    A person tracked elsewhere when the user pointed is not the one meant, wherever it walks.
    """

    def __init__(self, x_px: float, y_px: float, tracks: Tracks, now_s: float) -> None:
        """Look at a point of the newest frame.

        Args:
            x_px, y_px: where there is no track.
            tracks: of that frame.
            now_s: when it was pointed at.
        """
        super().__init__((x_px, y_px), tracks)
        self._others = {track.id for track in tracks.tracks if track.shown}
        self._since_s = now_s

    def for_s(self, now_s: float) -> float:
        """For how much longer a person is looked for, at least 0."""
        return max(0.0, self._since_s + PENDING_S - now_s)

    def found(self, tracks: Tracks, t_s: float) -> Track | None:
        """The person that has come to be tracked there: at the point, or alone within a step of it.

        Args:
            tracks: the newest frame.
            t_s: its time.
        """
        x, y = self.place_px
        new = tracks.model_copy(
            update={"tracks": tuple(t for t in tracks.tracks if t.id not in self._others)}
        )
        there = at_point(new, x, y)
        if there is not None:
            return there
        walked = _WALK_HEIGHTS_PER_S * min(max(t_s - self._since_s, 0.0), _WALK_S)
        by_it = [track for track in new.tracks if track.shown and _reaches(track, x, y, walked)]
        return by_it[0] if len(by_it) == 1 else None


def _reaches(track: Track, x_px: float, y_px: float, heights: float) -> bool:
    left, top, right, bottom = track.box_xyxy
    reach_px = heights * (bottom - top)
    return left - reach_px <= x_px <= right + reach_px and top <= y_px <= bottom
