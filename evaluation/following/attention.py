"""The person that the robot followed, at any distance: the right one, another one, none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heel.evaluation.following.log import NOBODY, EpisodeLog


def wrong_person_time(log: EpisodeLog) -> float:
    """Share of the episode's time in which the robot acts upon another person, 0 to 1.

    Waiting because it is unsure is not following: abstaining is right where two look alike.
    """
    wrong = (log.followed != NOBODY) & (log.followed != log.target)
    return float(wrong.mean())


def longest_loss_s(log: EpisodeLog) -> float:
    """Longest time in one go in which the robot does not follow the target, s.

    Time in which the target cannot be seen counts, too, and so does following another person. As
    "longest invisible run" in Follow-Bench 2.0, but of what the robot does, not of what it sees.
    """
    return longest_run(log.followed != log.target) * log.period_s


def longest_run(flags: NDArray[np.bool_]) -> int:
    """The longest run of true values."""
    padded = np.concatenate([[False], flags, [False]]).astype(np.int8)
    edges = np.flatnonzero(np.diff(padded))
    return int((edges[1::2] - edges[::2]).max(initial=0))
