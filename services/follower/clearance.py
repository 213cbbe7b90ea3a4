"""How far the robot may go before it meets a thing or comes too near to a person."""

from __future__ import annotations

import math
from dataclasses import dataclass

from schemas import Ranges

_LOOK_AHEAD_S = (0.25, 0.5, 0.75, 1.0)
_BESIDE_RAD = math.pi / 3
_PEOPLE_STOP_MPS2 = 3.0
"""How hard somebody who walks can brake."""


@dataclass(frozen=True, slots=True)
class Body:
    """The robot as a disc.

    Attributes:
        margin_m: kept free around it.
    """

    radius_m: float
    margin_m: float


def free_distance_m(ranges: Ranges, body: Body, direction_rad: float = 0.0) -> float | None:
    """How far the robot's front may go straight on in a direction; at least 0.

    A sector says that something may be anywhere on its arc, so its edge nearest to the path
    counts. None: no sector looks that way.
    """
    free_m = math.inf
    covered = False
    for sector in ranges.sectors:
        off_rad = abs(math.remainder(sector.bearing_rad - direction_rad, 2 * math.pi))
        nearest_rad = max(0.0, off_rad - sector.width_rad / 2)
        covered = covered or nearest_rad == 0.0
        # A wall close beside must not hold up a robot that drives along it.
        margin_m = body.margin_m if nearest_rad < _BESIDE_RAD else 0.0
        space_m = body.radius_m + margin_m
        beside_m = sector.distance_m * math.sin(min(nearest_rad, math.pi / 2))
        if nearest_rad < math.pi / 2 and beside_m < space_m:
            along_m = sector.distance_m * math.cos(nearest_rad)
            free_m = min(free_m, along_m - math.sqrt(space_m**2 - beside_m**2))
    return max(0.0, free_m) if covered else None


def room_before_person_m(
    place: tuple[float, float], velocity: tuple[float, float], space_m: float
) -> float:
    """How far the robot may go straight ahead before somebody is nearer than `space_m`.

    The person is taken to stop as hard as people can or to walk on for up to a second, whichever
    is worse. Somebody within that space counts only while the robot heads at them.

    Args:
        place: of the person, metres ahead and to the left.
        velocity: of the person in the same axes.
        space_m: that is to be kept from the robot's centre.

    Returns:
        Infinite for somebody who is behind or aside, at least 0.
    """
    room_m = math.inf
    stops_within_s = math.hypot(*velocity) / (2 * _PEOPLE_STOP_MPS2)
    for t_s in (stops_within_s, *_LOOK_AHEAD_S):
        x = place[0] + velocity[0] * t_s
        y = place[1] + velocity[1] * t_s
        if (
            x > 0
            and abs(y) < space_m
            and not (math.hypot(x, y) < space_m and math.atan2(abs(y), x) > _BESIDE_RAD)
        ):
            room_m = min(room_m, x - math.sqrt(space_m * space_m - y * y))
    return max(0.0, room_m)


def speed_to_stop_within_mps(room_m: float, braking_mps2: float, delay_s: float) -> float:
    """The greatest speed from which the robot stands within `room_m`, its delay included."""
    if room_m == math.inf:
        return math.inf
    lag = braking_mps2 * delay_s
    return math.sqrt(lag * lag + 2 * braking_mps2 * room_m) - lag
