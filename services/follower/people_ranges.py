"""How far people are by the range sensor: far more exact than a box, where it sees them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from heel.services.follower.clearance import BODY_M, Sectors
from heel.services.follower.estimate import PlaceFilter, polar_covariance
from heel.services.follower.own_motion import OwnMotion

_SIGMA_M = 0.06
"""Standard deviation of a range to a person, metres: clothes and swinging arms. Chosen by hand."""
_GATE_M = 0.35
"""Metres; a thing that is nearer than the person by more stands in between."""
_LONGEST_S = 0.25
"""Seconds between a range and the frame that it is used for; chosen by hand."""
_NARROW_RAD = 0.27
"""A person's width 2 m away. A wider sector may go on showing a wall beside them instead."""


@dataclass(frozen=True, slots=True)
class RangesInTime:
    """Free distances, and when they arrived on the clock of the follower."""

    sectors: Sectors
    t_s: float

    def sharpen(self, place: PlaceFilter, t_s: float, motion: OwnMotion) -> float | None:
        """Correct a place that the camera saw by the range in its direction, if they agree.

        Args:
            place: of a person at `t_s`; corrected along the line of sight.
            t_s: when the picture was taken.
            motion: where the robot was.

        Returns:
            How far a person in that direction is by a narrow sector; None if none shows one.
        """
        gap_s = self.t_s - t_s
        if abs(gap_s) > _LONGEST_S:
            return None
        pose = motion.pose_at(self.t_s)
        x_m, y_m = place.place_at(t_s)
        vx_mps, vy_mps = place.velocity
        ahead_m, left_m = pose.seen(x_m + vx_mps * gap_s, y_m + vy_mps * gap_s)
        bearing_rad, distance_m = math.atan2(left_m, ahead_m), math.hypot(ahead_m, left_m)
        range_m = self.sectors.towards_m(bearing_rad)
        if range_m is None:
            return None
        if abs(range_m + BODY_M - distance_m) <= _GATE_M:
            seen_x, seen_y = pose.place(range_m + BODY_M, bearing_rad)
            where = np.array([seen_x - vx_mps * gap_s, seen_y - vy_mps * gap_s])
            # A range says nothing of where across the line of sight.
            covariance = polar_covariance(pose.heading_rad + bearing_rad, 1.0, _SIGMA_M, 10.0)
            place.update(where, covariance, t_s)
        narrow_m = self.sectors.towards_m(bearing_rad, _NARROW_RAD)
        return None if narrow_m is None else narrow_m + BODY_M
