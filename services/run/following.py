"""How well the robot of a simulated world followed, judged by the world's truth."""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass

from schemas import FollowState, SimPerson, SimTruth, Tracks

_KEPT_FRAMES = 128
_LEAST_OVERLAP = 0.3
"""Intersection over union from which on a track is on a person."""
_ACTING = ("following", "occluded")


@dataclass
class FollowingFigures:
    """Sums over the episodes of a run, in SI units.

    Attributes:
        followed_s: time in which the robot acted upon the person of the scenario.
        wrong_s: time in which it acted upon anybody else.
        contacts: times the robot came to touch somebody.
        least_gap_m: least distance between the robot's body and anybody's; None before any frame.
        driven_m: length of the robot's way.
    """

    episodes: int = 0
    time_s: float = 0.0
    followed_s: float = 0.0
    wrong_s: float = 0.0
    contacts: int = 0
    least_gap_m: float | None = None
    driven_m: float = 0.0
    distance_sum_ms: float = 0.0

    @property
    def mean_distance_m(self) -> float:
        """Mean distance from the robot's centre to the person of the scenario."""
        return self.distance_sum_ms / self.time_s if self.time_s else 0.0


class FollowingTally:
    """Adds up what happens; whoever looks on feeds it with messages as they come."""

    def __init__(self) -> None:
        self.figures = FollowingFigures()
        self._truths: OrderedDict[int, SimTruth] = OrderedDict()
        self._last: SimTruth | None = None
        self._judged_s = 0.0
        self._state: FollowState | None = None

    def episode(self) -> None:
        """A new world begins."""
        self.figures.episodes += 1
        self._truths.clear()
        self._last = None
        self._judged_s = 0.0

    def state(self, state: FollowState) -> None:
        """What the follower does from now on."""
        self._state = state

    def truth(self, truth: SimTruth) -> None:
        """The world in one frame."""
        figures, last = self.figures, self._last
        self._last = truth
        self._truths[truth.seq] = truth
        while len(self._truths) > _KEPT_FRAMES:
            self._truths.popitem(last=False)
        for person in truth.people:
            gap_m = _distance(truth, person) - truth.robot_radius_m - person.radius_m
            if figures.least_gap_m is None or gap_m < figures.least_gap_m:
                figures.least_gap_m = gap_m
        if last is None or truth.t_s <= last.t_s:
            return
        passed_s = truth.t_s - last.t_s
        figures.time_s += passed_s
        figures.contacts += max(0, truth.contact - last.contact)
        figures.driven_m += math.hypot(
            truth.robot.x_m - last.robot.x_m, truth.robot.y_m - last.robot.y_m
        )
        figures.distance_sum_ms += passed_s * min(
            (_distance(truth, person) for person in truth.people if person.role == "target"),
            default=0.0,
        )

    def tracks(self, tracks: Tracks) -> None:
        """The tracks of one frame: whoever is under the followed one is whom the robot follows."""
        truth, state = self._truths.get(tracks.seq), self._state
        if truth is None or truth.t_s <= self._judged_s:
            return
        passed_s, self._judged_s = truth.t_s - self._judged_s, truth.t_s
        if state is None or state.state not in _ACTING:
            return
        box = next((t.box_xyxy for t in tracks.tracks if t.id == state.target.track_id), None)
        person = None if box is None else _under(box, truth.people)
        if person is not None and person.role == "target":
            self.figures.followed_s += passed_s
        elif person is not None:
            self.figures.wrong_s += passed_s


def _under(
    box: tuple[float, float, float, float], people: tuple[SimPerson, ...]
) -> SimPerson | None:
    """The visible person whose box overlaps most with `box`."""
    overlaps = [
        (_overlap(box, person.box_xyxy), person)
        for person in people
        if person.box_xyxy is not None and person.visible > 0
    ]
    best, person = max(overlaps, key=lambda pair: pair[0], default=(0.0, None))
    return person if best >= _LEAST_OVERLAP else None


def _overlap(
    one: tuple[float, float, float, float], other: tuple[float, float, float, float]
) -> float:
    wide = min(one[2], other[2]) - max(one[0], other[0])
    high = min(one[3], other[3]) - max(one[1], other[1])
    if wide <= 0 or high <= 0:
        return 0.0
    areas = sum((right - left) * (bottom - top) for left, top, right, bottom in (one, other))
    return wide * high / (areas - wide * high)


def _distance(truth: SimTruth, person: SimPerson) -> float:
    return math.hypot(person.pose.x_m - truth.robot.x_m, person.pose.y_m - truth.robot.y_m)
