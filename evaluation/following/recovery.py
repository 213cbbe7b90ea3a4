"""The person out of sight: is the identity the same afterwards, does the robot follow again?"""

from __future__ import annotations

import numpy as np

from heel.evaluation.following.attention import longest_run
from heel.evaluation.following.comfort import SEEN_SHARE
from heel.evaluation.following.log import NOBODY, EpisodeLog
from heel.evaluation.returns import Returns, Stories

_LONGEST_SEARCH_S = 5.0
"""Follow-Bench 2.0's `max_search_time_s`."""


def returns(log: EpisodeLog) -> Returns:
    """Absences and losses as in `heel.evaluation.returns`, of the target.

    An absence is one through full occlusion, and counts for the time in which nothing of the person
    was in view: hidden, or outside of the picture. Boxes on a person of whom nothing is in view do
    not end it. A loss is one of the robot: it acts upon another person or none.
    """
    tracked, followed = Stories(), Stories()
    in_view = log.people_visible > 0
    identities = np.where(in_view, log.identities, NOBODY)
    for row, people in enumerate(identities.tolist()):
        tracked.note(row, {who: None if one == NOBODY else one for who, one in enumerate(people)})
        right = log.followed[row] == log.target
        followed.note(row, {log.target: log.target if right else None})
    hidden = np.concatenate([[0], np.cumsum(~in_view[:, log.target])]).tolist()
    losses, delays_s = followed.losses(1.0 / log.period_s)
    absences = tracked.absences(
        1.0 / log.period_s, (log.target,), lambda gone, back: hidden[back] - hidden[gone]
    )
    return Returns(absences=absences, losses=losses, delays_s=delays_s)


def follow_bench_success(log: EpisodeLog) -> float:
    """SR of Follow-Bench 2.0: 1 if no loss of sight lasts more than 5 s and no person is touched.

    Its `search_success` and `obstacle_avoidance_success`. Sight is lost while less than a tenth of
    the person's box is to be seen; time before the first sight does not count. A person that stays
    hidden for longer has to be gone after: a robot that waits, fails.
    """
    seen = log.visible > SEEN_SHARE
    first = int(seen.argmax()) if seen.any() else 0
    unseen_s = longest_run(~seen[first:]) * log.period_s
    return float(unseen_s <= _LONGEST_SEARCH_S and not log.contact.any())
