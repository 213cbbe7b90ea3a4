"""The way that a person took, to drive along where the straight way to them is blocked.

Who goes through a door and on behind the wall is not reached straight: the robot would stand at the
wall beside the post. Where they walked there is room, and from there they are seen again.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from heel.services.follower.own_motion import Pose

_STEP_M = 0.15
"""Metres between places that are remembered; chosen by hand: less than places scatter by."""
_LONGEST_M = 8.0
"""Of the way that is remembered, metres; chosen by hand: what is behind the robot is not needed."""
_AGAIN_M = 1.5
"""Farther from the last place than that the person was out of sight meanwhile: the way between is
not known. Chosen by hand."""
_AIM_M = 0.4
"""A nearer place is no direction to drive in; chosen by hand."""
_PASSED_M = 0.3
"""Of places about as near to the robot, by so much, it is at the last; chosen by hand."""

Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Way:
    """The way on, along where the person walked.

    Attributes:
        bearing_rad: of the place to drive to next, left is positive.
        aim_m: how far that is.
        left_m: from the robot to the end of the way, along it.
    """

    bearing_rad: float
    aim_m: float
    left_m: float


class Trail:
    """Where a person was seen to walk, in the plane that does not move."""

    def __init__(self) -> None:
        """Nobody has been seen yet."""
        self._places: deque[Place] = deque(maxlen=round(_LONGEST_M / _STEP_M))
        self._end: Place | None = None

    def clear(self) -> None:
        """Another person is followed now."""
        self._places.clear()
        self._end = None

    def add(self, place: Place) -> None:
        """Note where the person is seen now."""
        if self._end is not None and math.dist(place, self._end) > _AGAIN_M:
            self._places.clear()
        if not self._places or math.dist(place, self._places[-1]) >= _STEP_M:
            self._places.append(place)
        self._end = place

    def way(self, pose: Pose, is_free: Callable[[float, float], bool]) -> Way | None:
        """The way on from a pose to where the person was seen last; None where there is none.

        It leads straight to the farthest place that is free to drive to, or to the next one where
        none is: along the way itself only as far as corners make it necessary.

        Args:
            pose: of the robot.
            is_free: whether a straight way is, by its bearing [rad] and length [m].
        """
        if self._end is None:
            return None
        places = [pose.seen(*place) for place in (*self._places, self._end)]
        apart_m = [math.hypot(*place) for place in places]
        nearest_m = min(apart_m) + _PASSED_M
        here = max(k for k, one_m in enumerate(apart_m) if one_m <= nearest_m)
        ahead = [k for k in range(here, len(places)) if apart_m[k] >= _AIM_M]
        if not ahead:
            return None
        bearings = [math.atan2(left, forward) for forward, left in places]
        aim = next((k for k in reversed(ahead) if is_free(bearings[k], apart_m[k])), ahead[0])
        rest = places[aim:]
        along_m = sum(math.dist(one, other) for one, other in pairwise(rest))
        return Way(bearings[aim], apart_m[aim], apart_m[aim] + along_m)
