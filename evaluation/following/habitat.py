"""Social navigation as Habitat 3.0 measures it: is the person found, and then followed?

Source: Puig et al., "Habitat 3.0: A Co-Habitat for Humans, Avatars and Robots" (2023), with the
thresholds of habitat-lab's `social_nav_sensors.py`. Distances are along the floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heel.evaluation.following.log import STEP_S, EpisodeLog

_NEAREST_M = 1.0
"""A step that follows is at least so far from the person; the benchmark's."""
_FARTHEST_M = 2.0
"""And at most so far; the benchmark's."""
_LEAST_FACING = 0.5
"""Cosine of the angle between the robot's heading and the person, 60 degrees; the benchmark's."""
_STEPS_TO_FIND = 1500
"""Steps in which the person has to be found; the benchmark's length of an episode."""


@dataclass(frozen=True, slots=True)
class HabitatScores:
    """Of one episode.

    Attributes:
        found: S, 1 or 0: at some step among the first 1500 the robot is 1.0 to 2.0 m along the
            floor from the person, and the cosine of the angle between its heading and the way to
            the person is above 0.5.
        path_efficiency: SPS = S l / max(l, p), 0 to 1. p: the step, counted from 1, in which the
            person is found first. l: the least step i by which the robot at full speed reaches
            the place where the person is at step i; the episode's length if there is none.
        following_rate: F = w / max(E - l, w), 0 to 1. w: steps in which the person is found.
            E: the episode's planned length in steps.
        collision: CR, 1 or 0: robot and any person touch.
    """

    found: float
    path_efficiency: float
    following_rate: float
    collision: float


def habitat_scores(log: EpisodeLog, max_speed_mps: float) -> HabitatScores:
    """Score one episode.

    Args:
        log: at any rate; scored in steps of `STEP_S`.
        max_speed_mps: of the robot, for l.
    """
    steps = log.in_steps()
    near = (steps.path_m >= _NEAREST_M) & (steps.path_m <= _FARTHEST_M)
    finds = near & (steps.facing() > _LEAST_FACING)
    oracle = _oracle_steps(steps, max_speed_mps)
    first = np.flatnonzero(finds[:_STEPS_TO_FIND])
    found = float(first.size > 0)
    efficiency = oracle / max(oracle, int(first[0]) + 1) if first.size else 0.0
    following = int(finds.sum())
    rate = following / max(steps.planned_steps - oracle, following, 1)
    return HabitatScores(found, efficiency, rate, float(log.contact.any()))


def _oracle_steps(steps: EpisodeLog, max_speed_mps: float) -> int:
    needed = steps.path_from_start_m / (max_speed_mps * STEP_S)
    numbers = np.arange(1, len(needed) + 1)
    reached = np.flatnonzero(needed < numbers)
    if reached.size:
        return int(numbers[reached[0]])
    # Contact may end the log before: what is missing is taken to be as its last moment.
    return min(steps.planned_steps, int(needed[-1]) + 1)
