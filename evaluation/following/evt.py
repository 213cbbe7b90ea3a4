"""Embodied visual tracking as EVT-Bench measures it: is the leader kept in sight to the end?

Source: Wang et al., "TrackVLA: Embodied Visual Tracking in the Wild" (2025), and the evaluation
loop of its code.
"""

from __future__ import annotations

from dataclasses import dataclass

from heel.evaluation.following.log import EpisodeLog

_FOLLOWING_M = 3.0
"""A step that follows is at most so far from the leader along the floor; the benchmark's."""
_TOO_FAR_M = 4.0
"""Beyond it, in a straight line, the leader is being lost; the benchmark's."""
_TOO_FAR_STEPS = 20
"""For longer the leader is lost, and the episode over; the benchmark's, in steps of `STEP_S`."""
_SEEN_SHARE = 0.25
"""Share of the leader's box that has to be seen; chosen by hand in place of the benchmark's 3,000
pixels, which belong to its own camera."""


@dataclass(frozen=True, slots=True)
class EvtScores:
    """Of one episode, in steps of 0.1 s.

    A step is a following one if the leader is at most 3.0 m away along the floor and seen: at
    least a quarter of their box is in the picture and not hidden (the original counts pixels of
    its own picture, 3000 or more). The episode is over, and lost, after more than 20 steps
    beyond 4.0 m (straight line) since the last following step; contact with a person ends it.

    Attributes:
        success: SR, 1 or 0: the planned end was reached, and its last step is a following one.
            (Episodes that end before could succeed by calling `stop`; a follower never does.)
        following_steps: until the episode is over.
        reference_steps: of the planned episode. TR of a set = sum of following steps / sum of
            reference steps.
        collision: CR, 1 or 0: robot and any person touch.
    """

    success: float
    following_steps: int
    reference_steps: int
    collision: float


def evt_scores(log: EpisodeLog) -> EvtScores:
    """Score one episode; a log at any rate is scored in steps."""
    steps = log.in_steps()
    following = (steps.path_m <= _FOLLOWING_M) & (steps.visible >= _SEEN_SHARE)
    too_far = steps.target_distance_m() > _TOO_FAR_M
    end, lost, far_steps = len(following), False, 0
    for index in range(len(following)):
        far_steps = 0 if following[index] else far_steps + int(too_far[index])
        if far_steps > _TOO_FAR_STEPS:
            end, lost = index + 1, True
            break
    collision = bool(log.contact.any())
    whole = not lost and not collision and len(following) >= steps.planned_steps
    return EvtScores(
        success=float(whole and bool(following[-1])),
        following_steps=int(following[:end].sum()),
        reference_steps=steps.planned_steps,
        collision=float(collision),
    )
