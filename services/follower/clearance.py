"""How far the robot may go before it meets a thing or comes too near to a person."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Ranges
from heel.schemas.robot import MAX_RANGE_M

BODY_M = 0.2
"""From the front of a person's body to its middle."""
_LOOK_AHEAD_S = (0.25, 0.5, 0.75, 1.0)
"""Seconds ahead at which a walking person is looked for; chosen by hand."""
_BESIDE_RAD = math.pi / 3
"""Bearing from which a thing is beside the robot and not ahead of it; chosen by hand."""
_BETWEEN_RAD = 0.1
"""A beam that fails between two that see, so near to both, shows what the nearer of them shows."""
_ROUNDING_RAD = 1e-6
"""Between the edges of two sectors that meet: above the rounding of any driver's angles."""
_DIRECTIONS = 63
"""Directions in which it is remembered that something was measured: steps of `_BETWEEN_RAD`, so
that a single narrow beam that is left out counts as one that failed."""
_STEP_RAD = 2 * math.pi / _DIRECTIONS
"""Between two of them."""
_PEOPLE_STOP_MPS2 = 3.0
"""How hard a walking person can brake."""


@dataclass(frozen=True, slots=True)
class Body:
    """The robot as a disc.

    Attributes:
        margin_m: kept free around it.
    """

    radius_m: float
    margin_m: float


@dataclass(frozen=True, slots=True)
class Room:
    """How far the robot may go.

    Attributes:
        ahead_m, behind_m: infinite where nothing says otherwise.
        ahead_ends_at: what the way ahead ends at, in words.
    """

    ahead_m: float
    behind_m: float
    ahead_ends_at: str


class Watched:
    """Directions that have ever been measured, in steps of about 0.1 rad.

    A driver that drops beams that fail, or show something too near, leaves out what it measured a
    moment ago: without memory the robot set off towards the wall that it had stood before.
    """

    def __init__(self) -> None:
        self._bearing = np.arange(_DIRECTIONS) * _STEP_RAD
        self._ever = np.zeros(_DIRECTIONS, bool)

    def left_out(self, table: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sectors (N, 3) of NaN where earlier messages have looked and these (M, 3) do not."""
        # Counted where sectors begin and end: every direction with every beam would take 4 ms.
        first = np.ceil((table[:, 0] - table[:, 1] / 2 - _ROUNDING_RAD) / _STEP_RAD)
        last = np.floor((table[:, 0] + table[:, 1] / 2 + _ROUNDING_RAD) / _STEP_RAD)
        count = np.clip(last - first + 1, 0, _DIRECTIONS).astype(int)
        start = np.remainder(first, _DIRECTIONS).astype(int)
        edges = np.zeros(2 * _DIRECTIONS + 1, int)
        np.add.at(edges, start, 1)
        np.add.at(edges, start + count, -1)
        looked = (edges.cumsum()[:-1].reshape(2, -1) > 0).any(axis=0)
        missing = self._bearing[self._ever & ~looked]
        self._ever |= looked
        return np.stack(
            [missing, np.full(len(missing), _STEP_RAD), np.full(len(missing), math.nan)], axis=1
        )


class Sectors:
    """Ranges as arrays: they are asked about several directions fifty times a second.

    Infinite ones are free as far as any sensor reaches, minus infinity is 0 m. What was not
    measured (NaN) is unknown, and the robot does not drive there.
    """

    def __init__(self, ranges: Ranges, watched: Watched | None = None) -> None:
        """Take one message.

        Args:
            ranges: newest.
            watched: what earlier messages measured; None: this is the first.
        """
        rows = [(s.bearing_rad, s.width_rad, s.distance_m) for s in ranges.sectors]
        table = np.array(rows, np.float64).reshape(-1, 3)
        if watched is not None:
            table = np.concatenate([table, watched.left_out(table)])
        table = _interpolated(table)
        unknown = np.isnan(table[:, 2])
        self._bearing, self._width, distance = table[~unknown].T
        self._distance = np.clip(distance, 0.0, MAX_RANGE_M)
        self._unknown_bearing, self._unknown_width, _ = table[unknown].T

    def free_m(self, body: Body, direction_rad: float = 0.0) -> float | None:
        """How far the robot's front may go straight on in a direction; at least 0.

        A sector says that something may be anywhere on its arc, so its edge nearest to the path
        counts. None: no sector looks that way. 0: the one that does has not measured.
        """
        if not _looks(self._bearing, self._width, direction_rad).any():
            unknown = _looks(self._unknown_bearing, self._unknown_width, direction_rad)
            return 0.0 if unknown.any() else None
        return self._way_m(body, direction_rad)

    def room_m(self, body: Body, direction_rad: float = 0.0) -> float:
        """As `free_m`; where no sector looks that way, up to what others show that is in it.

        Sonars leave gaps, and a robot is wider than a gap. Infinite: nothing is known to be there.
        """
        free_m = self.free_m(body, direction_rad)
        return self._way_m(body, direction_rad) if free_m is None else free_m

    def _way_m(self, body: Body, direction_rad: float) -> float:
        off = _angle(self._bearing - direction_rad)
        nearest = np.maximum(off - self._width / 2, 0.0)
        # A wall close beside must not hold up a robot that drives along it.
        margin_m = np.where(nearest < _BESIDE_RAD, body.margin_m, 0.0)
        space_m = body.radius_m + margin_m
        beside_m = self._distance * np.sin(nearest)
        met = (nearest < math.pi / 2) & (beside_m < space_m)
        along_m = self._distance * np.cos(nearest)
        free_m = along_m[met] - np.sqrt(space_m[met] ** 2 - beside_m[met] ** 2)
        return max(0.0, float(free_m.min(initial=math.inf)))

    def points(self) -> NDArray[np.float64]:
        """Where the sectors show something, (N, 2) metres ahead and to the left."""
        near = self._distance < MAX_RANGE_M
        directions = np.stack([np.cos(self._bearing[near]), np.sin(self._bearing[near])], axis=1)
        return np.asarray(self._distance[near, None] * directions)

    def towards_m(self, bearing_rad: float, widest_rad: float = math.inf) -> float | None:
        """The range of the sector that looks most nearly in a direction; None if none does.

        Args:
            bearing_rad: the direction.
            widest_rad: sectors wider than that are left out.
        """
        off = _angle(self._bearing - bearing_rad)
        off[(off > self._width / 2) | (self._width > widest_rad)] = math.inf
        nearest = int(off.argmin()) if off.size else -1
        return float(self._distance[nearest]) if nearest >= 0 and off[nearest] < math.inf else None


def _looks(
    bearing: NDArray[np.float64], width: NDArray[np.float64], direction_rad: float
) -> NDArray[np.bool_]:
    """Which sectors look in a direction; of two that meet there both do, whatever the rounding."""
    off = _angle(bearing - direction_rad)
    return np.asarray(off <= width / 2 + _ROUNDING_RAD)


def _angle(off_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """The size of angles, at most pi."""
    return np.abs(np.remainder(off_rad + math.pi, 2 * math.pi) - math.pi)


def _interpolated(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sectors (N, 3), where single beams that were not measured take the nearer of their two sides.

    Lidars lose a beam now and then; between two good ones that are close by it is no blind spot.
    """
    missing = np.isnan(table[:, 2])
    if missing.all() or not missing.any():
        return table
    good = table[~missing]
    for at in missing.nonzero()[0]:
        off = np.remainder(good[:, 0] - table[at, 0] + math.pi, 2 * math.pi) - math.pi
        left = good[(off >= 0) & (off <= _BETWEEN_RAD), 2]
        right = good[(off <= 0) & (off >= -_BETWEEN_RAD), 2]
        if left.size and right.size:
            table[at, 2] = min(left.min(), right.min())
    return table


def room_before_person_m(
    place: tuple[float, float], velocity: tuple[float, float], space_m: float
) -> float:
    """How far the robot may go straight ahead before a person is nearer than `space_m`.

    The person is taken to stop as hard as people can or to walk on for up to a second, whichever
    is worse. A person within that space counts only while the robot heads there.

    Args:
        place: of the person, metres ahead and to the left.
        velocity: of the person in the same axes.
        space_m: that is to be kept from the robot's centre.

    Returns:
        Infinite for a person that is behind or aside, at least 0.
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
