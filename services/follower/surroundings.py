"""What limits how far the robot may go now: people in sight, and ranges where there are any."""

from __future__ import annotations

import math

import numpy as np

from heel.services.follower.clearance import BODY_M, Body, Room, Sectors, room_before_person_m
from heel.services.follower.own_motion import Pose
from heel.services.follower.people import People
from heel.services.follower.settings import FollowerSettings

_TARGET_MARGIN_M = 0.25
"""Beyond personal space: the target is driven at all the time and stops without warning."""
_CHILDS_SHARE = 0.9
"""Of personal space, kept from a child that is taken for an adult: smoothed boxes and the robot's
own delay take their part, and of 1 m the promised 0.6 m are left; chosen by hand."""
_OTHERS_MARGIN_M = 0.2
"""Metres: a person that crosses also comes nearer without the robot."""
_PASSING_SPACE_M = 0.3
"""Metres kept free of people that the robot passes, beyond personal space; chosen by hand."""
_PASSING_FROM_M = 0.8
"""Metres ahead; nearer people are not steered clear of any more. Chosen by hand."""
_PASSING_AHEAD_M = 5.0
"""Metres ahead; farther people are not steered clear of yet. Chosen by hand."""
_WALK_MPS = 0.5
"""Speed of the robot assumed in looking for a way, m/s: a slow walk."""
_GREATEST_SIDESTEP_RAD = 0.35
"""Keeps the target in the picture of a camera with 60 degrees."""
_LEAST_SHARE = 0.4
"""Share of the distance: a child that is taken for an adult is not nearer by more than that."""
_CURVE_S = 0.3
"""A turning robot also looks where it will be heading by then."""
_DETOURS_RAD = tuple(side * 0.1 * step for step in range(16) for side in (1, -1))
"""Off the straight way, the least first, up to a right angle; chosen by hand: at 1.5 m a tenth is
half a robot's radius."""
_HIDES_M = 0.1
"""Metres; what is nearer than a person by more stands before them: ranges and boxes differ by so
much. Chosen by hand."""
_SAME_THING_M = 0.4
"""Metres between two measurements of one thing: a sector of 10 degrees is so wide 2.3 m away.
Chosen by hand."""
_TARGETS_SPACE, _OTHERS_SPACE = "personal space", "somebody else is in the way"
_OBSTACLE = "obstacle ahead"
Place = tuple[float, float]


class Surroundings:
    """Keeps the newest ranges and combines them with the people in sight."""

    def __init__(self, settings: FollowerSettings) -> None:
        self._settings = settings
        self._body = Body(settings.robot_radius_m, settings.obstacle_margin_m)
        self._sectors: Sectors | None = None
        self._arrived_s = -math.inf
        self._things = np.zeros((2, 0))

    @property
    def body_m(self) -> float:
        """From the robot's middle to what it keeps from, at least."""
        return self._body.radius_m + self._body.margin_m

    def observe(self, sectors: Sectors, now_s: float) -> None:
        """Take free distances at their arrival."""
        self._sectors, self._arrived_s = sectors, now_s

    def stale(self, now_s: float) -> bool:
        """Whether there were ranges once and they are too old now."""
        age_s = now_s - self._arrived_s
        return self._sectors is not None and age_s > self._settings.max_ranges_age_s

    def free_ahead_m(self, now_s: float) -> float | None:
        """How far the way ahead is free of things; None if no fresh range looks there."""
        if self._sectors is None or self.stale(now_s):
            return None
        return self._sectors.free_m(self._body)

    def room(
        self, people: People, target_id: int | None, pose: Pose, now_s: float,
        linear_mps: float, angular_radps: float, seen: bool, on_way: bool = False,
    ) -> Room:  # fmt: skip
        """How far the robot may go ahead and back.

        Args:
            people: all in sight.
            target_id: the one that is followed.
            pose: where the robot is now.
            now_s: the present.
            linear_mps: how fast it drives.
            angular_radps: how it turns.
            seen: whether the target is. Out of sight they may stand nearer than they would by now:
                whatever ranges show in their direction is kept from as they are.
            on_way: whether a thing is known to hide the target, so that ranges in their direction
                show that.
        """
        ways = [(math.inf, "")]
        for person in people.known.values():
            place = pose.seen(*person.filter.place_at(now_s))
            is_target = person.id == target_id
            behind = is_target and on_way
            if (person.by_height or not person.certain) and not behind:
                place = self._something_towards(place, _LEAST_SHARE)
            velocity = person.velocity(pose, now_s)
            margin_m = _TARGET_MARGIN_M if is_target else _OTHERS_MARGIN_M
            space_m = self._settings.personal_space_m + margin_m + person.reserve_m
            whose = _TARGETS_SPACE if is_target else _OTHERS_SPACE
            ways.append((room_before_person_m(place, velocity, space_m), whose))
            if person.least_share < 1.0:
                child = _as_child(place, velocity, person.least_share, linear_mps)
                childs_m = _CHILDS_SHARE * self._settings.personal_space_m
                ways.append((room_before_person_m(*child, childs_m), whose))
            if is_target and not seen and not behind:
                nearer = self._something_towards(place)
                ways.append((room_before_person_m(nearer, velocity, space_m), whose))
        behind_m = math.inf
        if self._sectors is not None:
            for direction_rad in (0.0, angular_radps * _CURVE_S):
                ways.append((self._sectors.room_m(self._body, direction_rad), _OBSTACLE))
            # A robot that has ranges but none behind does not back into the unknown.
            behind_m = self._sectors.free_m(self._body, math.pi) or 0.0
        ahead_m, ends_at = min(ways, key=lambda way: way[0])
        return Room(ahead_m, behind_m, ends_at)

    def _something_towards(
        self, place: tuple[float, float], least_share: float = 0.0
    ) -> tuple[float, float]:
        """What ranges show in the direction of a place, or the place itself if that is nearer.

        Args:
            place: metres ahead and to the left.
            least_share: what is nearer than so much of the way is something else.
        """
        distance_m, bearing_rad = math.hypot(*place), math.atan2(place[1], place[0])
        range_m = None if self._sectors is None else self._sectors.towards_m(bearing_rad)
        if range_m is None or not least_share * distance_m <= range_m + BODY_M < distance_m:
            return place
        share = (range_m + BODY_M) / distance_m
        return place[0] * share, place[1] * share

    def is_free(self, bearing_rad: float, way_m: float) -> bool:
        """Whether ranges show that the robot can drive so far straight in a direction."""
        if self._sectors is None:
            return False
        return (self._sectors.free_m(self._body, bearing_rad) or 0.0) >= way_m

    def is_blocked(self, bearing_rad: float, way_m: float) -> bool:
        """Whether ranges show something within a straight way in a direction."""
        if self._sectors is None:
            return False
        free_m = self._sectors.free_m(self._body, bearing_rad)
        return free_m is not None and free_m < way_m

    def note_things(self, pose: Pose) -> None:
        """Take what ranges show now for things: the target is seen elsewhere."""
        if self._sectors is not None:
            ahead, left = self._sectors.points().T
            cosine, sine = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
            self._things = np.stack(
                [pose.x_m + cosine * ahead - sine * left, pose.y_m + sine * ahead + cosine * left]
            )

    def thing_hides(self, place: Place, pose: Pose) -> bool:
        """Whether a thing stands before a place: one that has been noted, and is still measured.

        What has come since may be the target, or anybody else.

        Args:
            place: metres ahead and to the left.
            pose: of the robot.
        """
        distance_m, bearing_rad = math.hypot(*place), math.atan2(place[1], place[0])
        range_m = None if self._sectors is None else self._sectors.towards_m(bearing_rad)
        if range_m is None or range_m + BODY_M + _HIDES_M >= distance_m:
            return False
        x_m, y_m = pose.place(range_m, bearing_rad)
        off_m = np.hypot(self._things[0] - x_m, self._things[1] - y_m)
        return bool(off_m.min(initial=math.inf) < _SAME_THING_M)

    def detour_rad(self, bearing_rad: float, way_m: float, most_rad: float) -> float:
        """How far beside a direction to head, so that obstacles there are passed.

        Args:
            bearing_rad: where the robot would like to go.
            way_m: how far, at least, it has to be free.
            most_rad: of the detour.

        Returns:
            The least angle, left is positive, or the one with the longest way if none is free;
            0 without ranges.
        """
        if self._sectors is None or way_m <= 0.0:
            return 0.0
        best_m, best_rad = -1.0, 0.0
        for off_rad in _DETOURS_RAD:
            if abs(off_rad) > most_rad:
                break
            free_m = self._sectors.free_m(self._body, bearing_rad + off_rad) or 0.0
            if free_m >= way_m:
                return off_rad
            if free_m > best_m:
                best_m, best_rad = free_m, off_rad
        return best_rad

    def sidestep_rad(
        self, people: People, target_id: int | None, way: Pose, now_s: float, linear_mps: float
    ) -> float:
        """How far to head beside the target, so that others are passed with space.

        Every person that would be met too near pushes by the angle that makes up for it at the
        place of meeting.

        Args:
            people: all in sight.
            target_id: the one that is followed.
            way: where the robot is, heading straight to the target.
            now_s: the present.
            linear_mps: how fast it drives.
        """
        wished_m = self._settings.personal_space_m + _PASSING_SPACE_M
        # A robot that is held up looks for its way at a walk.
        speed_mps = max(linear_mps, _WALK_MPS)
        push_rad = 0.0
        for person in people.known.values():
            x_m, y_m = way.seen(*person.filter.place_at(now_s))
            vx_mps, vy_mps = way.turned(*person.filter.velocity)
            closing_mps = speed_mps - vx_mps
            if (
                person.id == target_id
                or not _PASSING_FROM_M < x_m < _PASSING_AHEAD_M
                or closing_mps < 0.1
            ):
                continue
            beside_m = y_m + vy_mps * x_m / closing_mps
            lacking_m = wished_m - abs(beside_m)
            if lacking_m > 0:
                travel_m = max(x_m * speed_mps / closing_mps, 1.0)
                push_rad -= math.copysign(lacking_m / travel_m, beside_m)
        return min(max(push_rad, -_GREATEST_SIDESTEP_RAD), _GREATEST_SIDESTEP_RAD)


def _as_child(
    place: tuple[float, float], velocity: tuple[float, float], share: float, linear_mps: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Place and velocity, in the robot's axes, of a person smaller and nearer than taken for.

    What a camera sees is motion relative to the robot, which shrinks with the distance; the robot's
    own does not.
    """
    x_mps, y_mps = velocity
    return (
        (share * place[0], share * place[1]),
        (linear_mps + share * (x_mps - linear_mps), share * y_mps),
    )
