"""How well the chosen person is seen in the newest frame."""

from __future__ import annotations

from typing import Literal

from heel.schemas import Track
from heel.services.follower.settings import FollowerSettings

Sight = Literal["clear", "doubtful", "hidden", "missed"]


def judge_sight(
    track: Track | None, located: bool, trusted: bool, settings: FollowerSettings
) -> tuple[Sight, str]:
    """How well a person is seen, and why not better.

    Args:
        track: of the chosen person, None if there is none.
        located: whether the box tells a place.
        trusted: whether the person is being followed: one that is not has to be surer.
        settings: the thresholds.
    """
    if track is None or track.state in ("lost", "new") or not track.shown:
        return "missed", "target missed"
    if track.state == "occluded":
        return "hidden", "target occluded"
    if not located:
        return "missed", "the target's box tells no place"
    least, lead = settings.resume_identity_confidence, settings.resume_identity_lead
    if trusted:
        least, lead = settings.min_identity_confidence, settings.min_identity_lead
    if track.identity_confidence < least:
        return "doubtful", "identity unsure"
    if track.identity_confidence - track.runner_up_confidence < lead:
        return "doubtful", "somebody else could be the target"
    return "clear", "target in sight"
