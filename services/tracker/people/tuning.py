"""Thresholds that differ between a robot and a file of boxes, and those that a user can set.

All other numbers of the tracker are constants of the modules that use them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from heel.services.tracker.settings import Reporting, TrackerSettings


@dataclass(frozen=True)
class Tuning:
    """Thresholds of the tracker.

    Attributes:
        birth_score: least score of a box that starts a track, share of a usual person's.
        shown_score: mean score from which a track is shown, likewise.
        hidden_score: mean score below which a shown track is hidden again, likewise.
        near_height: height below which a new track is not shown while a nearer person is in sight,
            picture heights.
        show_missed_s: time without a box for which a track is still shown.
        trust: least probability of a return that gives the old id back; above 1 none does.
        most_against_present: most log odds that colours take from a track that was seen a moment
            ago and that no other covers.
        reassure: weight of colours in settling a doubt, share of their log odds per second.
        min_height: height below which no track is shown, picture heights.
        forget_s: time without a box for which a track takes boxes, appearance unknown.
        forget_known_s: the same, where appearance guards against a wrong box.
        rivals: probability that the box of a track that was out of sight is another's, above which
            it gets a fresh id; where appearance is known that decides instead.
    """

    birth_score: float
    shown_score: float
    hidden_score: float
    near_height: float
    show_missed_s: float
    trust: float
    most_against_present: float
    reassure: float
    min_height: float = 0.0
    forget_s: float = 0.7
    forget_known_s: float = 2.0
    rivals: float = 0.1


FILE = Tuning(
    birth_score=0.6,
    shown_score=0.92,
    hidden_score=0.85,
    near_height=0.0,
    show_missed_s=0.0,
    trust=0.65,
    most_against_present=12.0,
    reassure=0.0,
)
"""For files of boxes, where every false box counts; chosen by hand on public detections."""

ROBOT = Tuning(
    birth_score=0.5,
    shown_score=0.85,
    hidden_score=0.4,
    near_height=0.08,
    show_missed_s=0.15,
    trust=0.75,
    most_against_present=3.0,
    reassure=1.0,
)
"""For a robot, for which a doubtful person is better than one lost for a frame, and whose turns
change the light, but not people, at once; chosen by hand."""


def tuned(usual: Tuning, settings: TrackerSettings) -> Tuning:
    """The usual thresholds, replaced by those that a user has set.

    Raises:
        SettingsError: a setting has no meaning for people's boxes.
    """
    settings.check("people")
    own = {"min_height": settings.min_height, "show_missed_s": settings.show_missed_s,
           "forget_s": settings.forget_s, "forget_known_s": settings.forget_s}  # fmt: skip
    return replace(usual, **{name: value for name, value in own.items() if value is not None})


def reporting_tuning(reporting: Reporting, identify: bool) -> Tuning:
    """The thresholds where births and reports are the front end's own.

    Args:
        reporting: for how long people are kept.
        identify: whether people who were forgotten are known again.
    """
    return replace(
        ROBOT, forget_s=reporting.forget_s, forget_known_s=reporting.forget_s,
        show_missed_s=reporting.show_missed_s, trust=ROBOT.trust if identify else math.inf,
    )  # fmt: skip
