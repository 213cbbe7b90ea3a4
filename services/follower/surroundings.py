"""What limits how far the robot may go now: people in sight, and ranges where there are any."""

from __future__ import annotations

import math

from schemas import Ranges
from services.follower.clearance import Body, free_distance_m, room_before_person_m
from services.follower.own_motion import Pose
from services.follower.people import People
from services.follower.settings import FollowerSettings

_SPACE_MARGIN_M = 0.15
"""For the errors of people's estimated places."""
_CURVE_S = 0.3
"""A turning robot also looks where it will be heading by then."""


class Surroundings:
    """Keeps the newest ranges and combines them with the people in sight."""

    def __init__(self, settings: FollowerSettings) -> None:
        self._settings = settings
        self._body = Body(settings.robot_radius_m, settings.obstacle_margin_m)
        self._ranges: Ranges | None = None
        self._arrived_s = -math.inf

    def observe(self, ranges: Ranges, now_s: float) -> None:
        """Take free distances at their arrival."""
        self._ranges, self._arrived_s = ranges, now_s

    def stale(self, now_s: float) -> bool:
        """Whether there were ranges once and they are too old now."""
        age_s = now_s - self._arrived_s
        return self._ranges is not None and age_s > self._settings.max_ranges_age_s

    def free_ahead_m(self, now_s: float) -> float | None:
        """How far the way ahead is free of things; None if no fresh range looks there."""
        if self._ranges is None or self.stale(now_s):
            return None
        return free_distance_m(self._ranges, self._body)

    def room_m(
        self, people: People, pose: Pose, now_s: float, angular_radps: float
    ) -> tuple[float, float]:
        """How far the robot may go ahead and back, infinite where nothing says otherwise.

        Args:
            people: everybody in sight.
            pose: where the robot is now.
            now_s: the present.
            angular_radps: how it turns.
        """
        space_m = self._settings.personal_space_m + _SPACE_MARGIN_M
        ahead_m = behind_m = math.inf
        for person in people.known.values():
            place = pose.seen(*person.filter.place_at(now_s))
            velocity = pose.turned(*person.filter.velocity)
            ahead_m = min(ahead_m, room_before_person_m(place, velocity, space_m))
        if self._ranges is not None:
            for direction_rad in (0.0, angular_radps * _CURVE_S):
                free_m = free_distance_m(self._ranges, self._body, direction_rad)
                ahead_m = min(ahead_m, math.inf if free_m is None else free_m)
            # Who has ranges but none behind does not back into the unknown.
            behind_m = free_distance_m(self._ranges, self._body, math.pi) or 0.0
        return ahead_m, behind_m
