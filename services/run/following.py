"""Figures of following in a simulated world, summed up while it runs."""

from __future__ import annotations

import json
import math
import os
from dataclasses import asdict, dataclass
from pathlib import Path

from heel.schemas import FollowState, SimPerson, SimTruth
from heel.services.loops.judge import acted_upon
from heel.services.run.summary import Perception


@dataclass
class FollowingFigures:
    """Sums over the episodes of a run, in SI units.

    Attributes:
        followed_s: time in which the robot acted upon the person of the scenario.
        wrong_s: time in which it acted upon another person.
        contacts: times the robot came to touch a person.
        least_gap_m: least distance between the robot's body and a person's; None before any frame.
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
    """Sums up figures frame by frame; a `Recorder`. Runs may last for days: no frame is kept."""

    def __init__(self) -> None:
        self.figures = FollowingFigures()
        self._last: SimTruth | None = None

    def episode(self) -> None:
        """A new world begins."""
        self.figures.episodes += 1
        self._last = None

    def record(self, truth: SimTruth, state: FollowState | None, people: dict[int, int]) -> None:
        """As `Recorder.record`; the time since the frame before counts as this frame."""
        figures, last = self.figures, self._last
        self._last = truth
        for person in truth.people:
            gap_m = _distance_m(truth, person) - truth.robot_radius_m - person.radius_m
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
            (_distance_m(truth, person) for person in truth.people if person.role == "target"),
            default=0.0,
        )
        followed = None if state is None else acted_upon(state, people)
        if followed is None or followed >= len(truth.people):
            return
        if truth.people[followed].role == "target":
            figures.followed_s += passed_s
        else:
            figures.wrong_s += passed_s


def write_figures(
    figures: FollowingFigures, perception: str, seen: Perception | None, folder: Path
) -> None:
    """Write `following.json`, whole or not at all.

    Args:
        figures: of the run.
        perception: pixels, or the simulator's own boxes.
        seen: what found people in the pixels.
        folder: to write into.

    Raises:
        OSError: the folder cannot be written to.
    """
    whole = folder / f".following.json.{os.getpid()}"
    try:
        with whole.open("x", encoding="utf-8") as file:
            told = {"perception": perception, "people": None if seen is None else asdict(seen)}
            file.write(json.dumps({**told, **asdict(figures)}, indent=2) + "\n")
        whole.replace(folder / "following.json")
    except OSError:
        whole.unlink(missing_ok=True)
        raise


def _distance_m(truth: SimTruth, person: SimPerson) -> float:
    return math.hypot(person.pose.x_m - truth.robot.x_m, person.pose.y_m - truth.robot.y_m)
