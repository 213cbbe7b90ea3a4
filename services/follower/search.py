"""Looking round for a person out of sight: by turning only, so far and no longer."""

from __future__ import annotations

import math
from collections.abc import Sequence

from heel.services.follower.own_motion import Pose

_REACHED_RAD = 0.08
"""Radians from a heading within which it counts as reached; chosen by hand."""


class Search:
    """Turns to headings, one after the other, and gives up.

    Args:
        headings: radians, in the plane that does not move.
    """

    def __init__(self, headings: Sequence[float]) -> None:
        self._headings = headings
        self._leg = 0

    @property
    def over(self) -> bool:
        """Whether the robot has looked everywhere it may."""
        return self._leg >= len(self._headings)

    def give_up(self) -> None:
        """It took too long."""
        self._leg = len(self._headings)

    def bearing_rad(self, pose: Pose) -> float:
        """Where to turn now, from the robot's present heading; 0 when it is over."""
        while not self.over:
            off_rad = self._headings[self._leg] - pose.heading_rad
            if abs(off_rad) > _REACHED_RAD:
                return off_rad
            self._leg += 1
        return 0.0


def all_around(start: Pose) -> Search:
    """One turn on the spot, to the left, from where the robot is now."""
    return Search([start.heading_rad + 2 * math.pi])


def search_for(
    start: Pose, expected: tuple[float, float], last_seen: tuple[float, float], sideways: float,
    sweep_rad: float,
) -> Search:  # fmt: skip
    """Looks where the person is expected, then to both sides.

    In the end it faces where the person was last seen: one that has gone behind a thing comes
    back there sooner than through the wall.

    Args:
        start: where the robot is now.
        expected: place at which the person is expected.
        last_seen: place at which the person was last seen.
        sideways: which side the person was going to, +1 left, -1 right.
        sweep_rad: how far to either side of the expected place.
    """
    first_rad = _heading_rad(start, expected)
    offsets = (0.0, sideways * sweep_rad, -sideways * sweep_rad)
    return Search([*(first_rad + offset for offset in offsets), _heading_rad(start, last_seen)])


def _heading_rad(pose: Pose, place: tuple[float, float]) -> float:
    """The heading that looks at a place, as few turns as possible from the present one."""
    ahead, left = pose.seen(*place)
    return pose.heading_rad + math.atan2(left, ahead)
