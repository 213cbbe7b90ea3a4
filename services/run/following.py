"""How well the robot of a simulated world followed, judged by the world's truth."""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass

import numpy as np

from heel.evaluation.alignment import best_pairs, iou_matrix
from heel.schemas import FollowState, SimPerson, SimTruth, Tracks

_KEPT_FRAMES = 128
_LEAST_IOU = 0.3
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
        person = _person_under(state.target.track_id, tracks, truth.people)
        if person is not None and person.role == "target":
            self.figures.followed_s += passed_s
        elif person is not None:
            self.figures.wrong_s += passed_s


def _person_under(
    track_id: int | None, tracks: Tracks, people: tuple[SimPerson, ...]
) -> SimPerson | None:
    """Whom a track is on: tracks and visible people are paired one to one at the highest IoU."""
    size = np.array([tracks.width, tracks.height] * 2, np.float64)
    seen = [(p, p.box_xyxy) for p in people if p.box_xyxy is not None and p.visible > 0]
    tracked = np.array([track.box_xyxy for track in tracks.tracks], np.float64).reshape(-1, 4)
    true = np.array([box for _, box in seen], np.float64).reshape(-1, 4)
    overlaps = iou_matrix(np.clip(tracked, 0.0, size), np.clip(true, 0.0, size))
    rows, columns = best_pairs(overlaps, _LEAST_IOU)
    on = {tracks.tracks[row].id: seen[column][0]
          for row, column in zip(rows, columns, strict=True)}  # fmt: skip
    return None if track_id is None else on.get(track_id)


def _distance(truth: SimTruth, person: SimPerson) -> float:
    return math.hypot(person.pose.x_m - truth.robot.x_m, person.pose.y_m - truth.robot.y_m)
