"""What happened in one episode, as arrays: all that the scores of following are made of."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from heel.schemas.errors import HeelError

STEP_S = 0.1
"""A step of Habitat and EVT-Bench, whose policies act at about 10 Hz; their limits count steps."""
NOBODY = -1
"""In `EpisodeLog`: the robot follows nobody, or no track is on a person."""

Reals = NDArray[np.float64]
_BESIDES_STEPS = ("planned_s", "robot_radius_m", "people_radius_m", "target")


@dataclass(frozen=True, slots=True)
class EpisodeLog:
    """The truth of one episode at N equidistant moments, with P people.

    The log ends early when robot and a person touch: contact ends an episode.

    Attributes:
        planned_s: how long the episode lasts if nothing ends it before, s.
        robot_radius_m: the robot's body is a disc.
        people_radius_m: (P,) so are people's.
        target: index of the person to be followed, 0 to P - 1.
        t_s: (N,) simulated time, equidistant.
        robot_xy_m: (N, 2) centre of the robot.
        robot_heading_rad: (N,) 0 looks along x, left is positive.
        linear_mps: (N,) real velocity, forward is positive.
        angular_radps: (N,) real turn rate, left is positive.
        people_xy_m: (N, P, 2) centres of all people.
        path_m: (N,) shortest way on the floor from robot to target, m.
        path_from_start_m: (N,) shortest way from where the robot was first to the target now, m.
        visible: (N,) share of the target's box that is to be seen in the picture, 0 to 1.
        people_visible: (N, P) the same of everybody.
        identities: (N, P) id of the track on each person in the newest picture, `NOBODY` for none.
        followed: (N,) index of the person that the robot acts upon, `NOBODY` if upon no one.
        contact: (N,) whether robot and any person touch.
        state: (N,) name of the follower's state.
    """

    planned_s: float
    robot_radius_m: float
    people_radius_m: Reals
    target: int
    t_s: Reals
    robot_xy_m: Reals
    robot_heading_rad: Reals
    linear_mps: Reals
    angular_radps: Reals
    people_xy_m: Reals
    path_m: Reals
    path_from_start_m: Reals
    visible: Reals
    people_visible: Reals
    identities: NDArray[np.int64]
    followed: NDArray[np.int64]
    contact: NDArray[np.bool_]
    state: NDArray[np.str_]

    def __post_init__(self) -> None:
        """Check that the arrays belong together.

        Raises:
            HeelError: they do not, or there is not a single step.
        """
        count, people = len(self.t_s), len(self.people_radius_m)
        for field in fields(self):
            if field.name in _BESIDES_STEPS:
                continue
            length = len(getattr(self, field.name))
            if length != count or not count:
                raise HeelError(
                    f"episode log: {length} rows of {field.name} beside {count} of t_s: give every "
                    "array one row a step, and at least one step"
                )
        if self.people_xy_m.shape != (count, people, 2) or not 0 <= self.target < people:
            raise HeelError(
                f"episode log: people_xy_m of shape {self.people_xy_m.shape} and target "
                f"{self.target} do not go with {people} people: give (steps, people, 2) and an "
                "index below the number of people"
            )

    @property
    def period_s(self) -> float:
        """Time between two moments, s."""
        return float(self.t_s[1] - self.t_s[0]) if len(self.t_s) > 1 else STEP_S

    @property
    def planned_steps(self) -> int:
        """How many moments there are if nothing ends the episode early."""
        return max(len(self.t_s), round(self.planned_s / self.period_s))

    def in_steps(self) -> EpisodeLog:
        """The same episode at one moment every `STEP_S`; contact within a step is kept."""
        stride = max(1, round(STEP_S / self.period_s))
        # The end of each step counts, so that the episode's last moment is the last step.
        picked = np.arange(len(self.t_s) - 1, -1, -stride)[::-1]
        shown = {
            field.name: getattr(self, field.name)[picked]
            for field in fields(self)
            if field.name not in _BESIDES_STEPS
        }
        return replace(self, **shown)

    def target_distance_m(self) -> Reals:
        """(N,) distance from centre to centre of robot and target, m."""
        return self.distances_m()[:, self.target]

    def distances_m(self) -> Reals:
        """(N, P) distance from centre to centre of robot and each person, m."""
        offsets = self.people_xy_m - self.robot_xy_m[:, None, :]
        distances: Reals = np.linalg.norm(offsets, axis=2)
        return distances

    def facing(self) -> Reals:
        """(N,) cosine of the angle between the robot's heading and the way to the target."""
        offset = self.people_xy_m[:, self.target] - self.robot_xy_m
        distance = np.linalg.norm(offset, axis=1)
        ahead = np.stack([np.cos(self.robot_heading_rad), np.sin(self.robot_heading_rad)], axis=1)
        cosines: Reals = (ahead * offset).sum(axis=1) / np.maximum(distance, 1e-9)
        return cosines
