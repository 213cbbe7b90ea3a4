"""How to drive after the chosen person: straight, beside obstacles, and along the way they took.

The straight way is the rule. Obstacles that ranges show are headed past, and so are other people.
With `trail_s` the robot goes after somebody hidden by a thing along their way: through a door.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from heel.services.follower.clearance import BODY_M
from heel.services.follower.controller import Goal, VelocityController
from heel.services.follower.own_motion import OwnMotion
from heel.services.follower.people import People
from heel.services.follower.settings import FollowerSettings
from heel.services.follower.surroundings import Surroundings
from heel.services.follower.trail import Trail, Way

_WAY_M = 1.5
"""Way before the robot that obstacles are looked for on in time; chosen by hand."""
_SLACK_M = 0.1
"""Of the way to a person that need not be free, beyond their body and the robot's: ranges vary;
chosen by hand."""
_TRAIL_MPS = 1.0
"""Fastest after somebody that a thing hides, m/s: a walk. Chosen by hand."""
_ARRIVED_M = 0.3
"""From the end of their way, metres: the robot looks round from there. Chosen by hand."""
_IN_VIEW = 0.8
"""Share of half the camera's view by which the robot heads beside a person, at most; chosen by
hand: the person stays in the picture."""

Velocity = tuple[float, float]
"""Forward [m/s] and turning to the left [rad/s]."""


@dataclass(frozen=True, slots=True)
class Pursued:
    """What is known of the chosen person at a moment.

    Attributes:
        track_id: theirs; None where nobody is chosen.
        now_s: the moment.
        unseen_s: since they were last seen well enough to be followed.
        missing: whether the newest frame is without them.
        behind_people: whether other people hide them there.
    """

    track_id: int | None
    now_s: float
    unseen_s: float
    missing: bool
    behind_people: bool


class Pursuit:
    """Velocities after one person, in a plane in which people, things and the robot have places."""

    def __init__(
        self, settings: FollowerSettings, people: People, motion: OwnMotion,
        surroundings: Surroundings,
    ) -> None:  # fmt: skip
        """Start at rest.

        Args:
            settings: of the follower.
            people: where everybody is.
            motion: where the robot is.
            surroundings: what limits it.
        """
        self._settings = settings
        self._people = people
        self._motion = motion
        self._surroundings = surroundings
        self._controller = VelocityController(settings)
        self._trail = Trail()
        self._goes_after = False
        self._told: Velocity = (0.0, 0.0)

    @property
    def swings(self) -> bool:
        """Whether the robot has been turning to and fro."""
        return self._controller.swings

    @property
    def speed_reason(self) -> str:
        """What bounds the speed that was told last; empty while nothing moves."""
        return self._controller.speed_reason

    def begin(self) -> None:
        """Somebody else is chosen, or nobody."""
        self._trail.clear()
        self._goes_after = False

    def seen_at(self, place: tuple[float, float]) -> None:
        """Note where the person is seen, so that their way can be driven."""
        if self._settings.trail_s:
            self._trail.add(place)
            self._surroundings.note_things(self._motion.pose)

    def stand(self) -> Velocity:
        """Zero at once."""
        return self._remembered(self._controller.stop())

    def turn_to(self, bearing_rad: float, dt_s: float) -> Velocity:
        """Turn on the spot until a direction is ahead."""
        rate_radps = self._controller.turn_to(bearing_rad, self._settings.search_radps)
        return self._remembered(self._controller.turn(rate_radps, dt_s))

    def follow(self, target: Pursued, seen: bool, dt_s: float) -> Velocity:
        """Drive after the person: while seen, and for `coast_s` or along their way while not.

        Args:
            target: whom; known by a place.
            seen: whether they are followed by sight.
            dt_s: since the last velocity.
        """
        on_way = self.on_way(target)
        goal = self.goal(target)
        if not seen and not on_way and target.unseen_s > self._settings.coast_s:
            rate_radps = self._controller.turn_to(goal.bearing_rad, self._settings.search_radps)
            return self._remembered(self._controller.brake_and_turn(rate_radps, dt_s))
        people, pose, surroundings = self._people, self._motion.pose, self._surroundings
        linear_mps, angular_radps = self._told
        room = surroundings.room(
            people, target.track_id, pose, target.now_s, linear_mps, angular_radps, seen, on_way
        )
        goal, beside_rad = self._round_things(goal, target, seen, on_way)
        heading = replace(pose, heading_rad=pose.heading_rad + goal.bearing_rad)
        beside_rad += surroundings.sidestep_rad(
            people, target.track_id, heading, target.now_s, linear_mps
        )
        most_rad = self._most_beside_rad
        beside_rad = min(max(beside_rad, -most_rad), most_rad)
        most_mps = math.inf if seen else max(linear_mps, _TRAIL_MPS * on_way)
        return self._remembered(self._controller.follow(goal, room, beside_rad, dt_s, most_mps))

    def by_hand(self, wished: tuple[float, float], now_s: float, dt_s: float) -> Velocity:
        """As a hand wishes, slower than following, with the same braking.

        Args:
            wished: forward and to the left, shares from -1 to 1 of what a hand may.
            now_s: the moment.
            dt_s: since the last velocity.
        """
        s = self._settings
        room = self._surroundings.room(
            self._people, None, self._motion.pose, now_s, *self._told, seen=True
        )
        forward_mps = wished[0] * min(s.manual_linear_mps, s.max_linear_mps)
        left_radps = wished[1] * min(s.manual_angular_radps, s.max_angular_radps)
        return self._remembered(self._controller.by_hand(forward_mps, left_radps, room, dt_s))

    def goal(self, target: Pursued) -> Goal:
        """The person as seen when what is told now takes effect."""
        person = self._people.known[target.track_id or 0]
        pose, t_s = self._motion.pose_soon(), target.now_s + self._settings.robot_delay_s
        return Goal(pose.seen(*person.filter.place_at(t_s)), person.velocity(pose, t_s))

    def on_way(self, target: Pursued) -> bool:
        """Whether a thing hides the person, and the way that they took is to be driven."""
        person = self._people.known.get(target.track_id or 0)
        if person is None or not target.missing:
            self._goes_after = False
            return False
        pose = self._motion.pose
        place = pose.seen(*person.filter.place_at(target.now_s))
        bearing_rad = math.atan2(place[1], place[0])
        if (
            target.unseen_s > self._settings.trail_s
            or target.behind_people
            or self._somebody_towards(target, bearing_rad, math.hypot(*place))
        ):
            return False
        way = self._trail.way(pose, self._surroundings.is_free)
        if way is None or way.left_m <= _ARRIVED_M:
            return False
        # Who leaves the picture while the robot drives round a corner is gone after, too; once
        # the place where they should be is in view, it is looked at.
        hidden = self._surroundings.thing_hides(place, pose)
        aside = abs(bearing_rad) > self._people.half_view_rad
        self._goes_after |= hidden or (aside and way.aim_m < way.left_m)
        return self._goes_after and (hidden or aside)

    @property
    def _most_beside_rad(self) -> float:
        return _IN_VIEW * self._people.half_view_rad

    def _round_things(
        self, goal: Goal, target: Pursued, seen: bool, on_way: bool
    ) -> tuple[Goal, float]:
        """Where to drive, and how far beside that to head, so that things are passed."""
        surroundings, most_rad = self._surroundings, self._most_beside_rad
        way_m = min(goal.distance_m - surroundings.body_m - BODY_M - _SLACK_M, _WAY_M)
        beside_rad = surroundings.detour_rad(goal.bearing_rad, way_m, most_rad)
        if on_way or (seen and self._is_blocked(target, goal.bearing_rad + beside_rad, way_m)):
            way = self._trail.way(self._motion.pose_soon(), surroundings.is_free)
            if way is not None:
                goal = _along(goal, way, seen, self._settings.distance_m)
                aim_m = min(way.aim_m, _WAY_M)
                beside_rad = surroundings.detour_rad(way.bearing_rad, aim_m, most_rad)
        return goal, beside_rad

    def _is_blocked(self, target: Pursued, bearing_rad: float, way_m: float) -> bool:
        """Whether a thing is in the way in a direction, and nobody who will have passed soon."""
        return (
            self._settings.trail_s > 0
            and self._surroundings.is_blocked(bearing_rad, way_m)
            and not self._somebody_towards(target, bearing_rad, way_m)
        )

    def _somebody_towards(self, target: Pursued, bearing_rad: float, way_m: float) -> bool:
        """Whether somebody else is about in a direction, and nearer than so far."""
        return self._people.anybody_towards(
            self._motion.pose, bearing_rad, way_m, target.now_s, but=target.track_id
        )

    def _remembered(self, told: Velocity) -> Velocity:
        self._told = told
        return told


def _along(goal: Goal, way: Way, seen: bool, distance_m: float) -> Goal:
    """Somebody at the end of a way, as if it were straight; who is not seen is driven up to.

    Args:
        goal: where they are.
        way: that leads there.
        seen: whether they are.
        distance_m: wished to those that are seen.
    """
    towards = math.cos(way.bearing_rad), math.sin(way.bearing_rad)
    ahead_m = way.left_m if seen else way.left_m + distance_m
    speed_mps = math.hypot(*goal.velocity) if seen else 0.0
    return Goal(
        (ahead_m * towards[0], ahead_m * towards[1]),
        (speed_mps * towards[0], speed_mps * towards[1]),
    )
