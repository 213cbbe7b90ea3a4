"""The follower's states: one function each, from the situation to the next state and its reason.

What overrules every state stands in `overruled`, in order: emergency stop, a sensor that cannot be
read, a blind range sensor, no target chosen, nothing seen yet, stale tracks, a choice that may mean
either of two, a target that may be a thing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from heel.schemas.follow import FollowStateName
from heel.services.follower.settings import FollowerSettings
from heel.services.follower.sight import Sight

Step = tuple[FollowStateName, str]


@dataclass(frozen=True, slots=True)
class Situation:
    """All that the choice of a state rests on.

    Attributes:
        ranges_stale: ranges were there once and are too old now.
        chosen: whether there is a target or one is waited for.
        chosen_reason: what is said while no person is chosen or one is still waited for.
        target_id: of the chosen person.
        tracks_age_s: None before the first tracks.
        sight, sight_reason: of the chosen person in the newest frame.
        clear_s: for how long the sight has been clear without a break.
        unseen_s: since the person was last seen, infinite if never.
        searching_s: since the search began.
        looked_everywhere: whether the search has been everywhere.
        on_way: whether the robot goes on, unseen, along the way that the person took.
        looks_around: whether to look for the first person, none being in view.
        undecided: which two the choice may mean, in words; "" once that is clear.
        proven: whether the target is known to be a person at all.
        unreadable: which sensor speaks and cannot be read, in words; "" if none.
        stale: why nothing may rest on the tracks, None if they are fresh.
        frozen: whether the picture stands still although the robot moved.
        unsought: whether stale tracks ended the following, and nobody has looked for it since.
    """

    estop: bool
    ranges_stale: bool
    chosen: bool
    chosen_reason: str
    target_id: int | None
    tracks_age_s: float | None
    sight: Sight
    sight_reason: str
    clear_s: float
    unseen_s: float
    searching_s: float
    looked_everywhere: bool
    on_way: bool = False
    looks_around: bool = False
    undecided: str = ""
    proven: bool = True
    unreadable: str = ""
    stale: str | None = None
    frozen: bool = False
    unsought: bool = False


def next_state(present: FollowStateName, now: Situation, settings: FollowerSettings) -> Step:
    """The state of this moment and the reason for it."""
    return overruled(now, settings) or _STATES[present](now, settings)


def by_hand(now: Situation, settings: FollowerSettings, words: str) -> Step:
    """The state while somebody drives by hand: only what stops everybody stops them."""
    return _stopped(now, settings) or ("idle", words[:96])


def _stopped(now: Situation, settings: FollowerSettings) -> Step | None:
    """What stops the robot whoever drives it."""
    if now.estop:
        return "stopped", "emergency stop"
    if now.unreadable:
        return "stopped", now.unreadable[:96]
    if now.ranges_stale:
        return "stopped", f"ranges are older than {settings.max_ranges_age_s:g} s"
    return None


def overruled(now: Situation, settings: FollowerSettings) -> Step | None:
    """What holds whatever the state was; None if nothing does."""
    if (stopped := _stopped(now, settings)) is not None:
        return stopped
    if not now.chosen:
        return "idle", now.chosen_reason[:96] or "no target"
    if now.tracks_age_s is None:
        return "acquiring", "no tracks yet"
    if now.stale is not None:
        return "lost", now.stale
    if now.frozen:
        return "stopped", "the picture does not move though the robot does: is the camera frozen?"
    if now.target_id is None:
        if now.looks_around and settings.search_s > 0:
            return "searching", "looking around for somebody to follow"
        return "acquiring", now.chosen_reason[:96]
    if now.undecided:
        return "unsure", now.undecided[:96]
    if not now.proven and now.sight in ("clear", "doubtful"):
        return "acquiring", "no proof yet that this is a person: turning only"
    return None


def acquiring(now: Situation, settings: FollowerSettings) -> Step:
    """Chosen or back in sight: make sure before moving. Also the way out of idle and stopped."""
    if now.sight == "clear" and now.clear_s >= settings.confirm_s:
        return "following", now.sight_reason
    if now.sight == "clear":
        return "acquiring", "making sure"
    if now.sight == "doubtful":
        return "unsure", now.sight_reason
    return ("lost", "target lost") if now.unseen_s > settings.hold_s else (
        "acquiring", now.sight_reason
    )  # fmt: skip


def following(now: Situation, settings: FollowerSettings) -> Step:
    """In sight and surely the one."""
    if now.sight == "clear":
        return "following", now.sight_reason
    if now.sight == "doubtful":
        return "unsure", now.sight_reason
    return occluded(now, settings)


def occluded(now: Situation, settings: FollowerSettings) -> Step:
    """Out of sight since a moment: brake, and turn to where the person should be.

    Who went behind a thing is gone after, as far as they were seen to walk.
    """
    if now.sight == "clear":
        return "following", now.sight_reason
    if now.sight == "doubtful":
        return "unsure", now.sight_reason
    if now.on_way:
        return "occluded", "hidden behind a thing: along the way they took"
    if now.unseen_s <= settings.hold_s:
        return "occluded", now.sight_reason
    return searching(now, settings)


def unsure(now: Situation, settings: FollowerSettings) -> Step:
    """A person is there that may be the target: stand still until that is clear."""
    if now.sight == "clear" and now.clear_s >= settings.confirm_s:
        return "following", now.sight_reason
    if now.sight == "clear":
        return "unsure", "making sure"
    if now.sight == "doubtful" or now.unseen_s <= settings.hold_s:
        return "unsure", now.sight_reason
    return searching(now, settings)


def searching(now: Situation, settings: FollowerSettings) -> Step:
    """Out of sight for longer: look round, for so long and so far."""
    if now.sight in ("clear", "doubtful"):
        return acquiring(now, settings)
    if now.looked_everywhere:
        return "lost", "target lost: looked everywhere"
    if now.searching_s >= settings.search_s:
        return "lost", f"target lost: not found within {settings.search_s:g} s"
    return "searching", "looking where the target was last seen"


def lost(now: Situation, settings: FollowerSettings) -> Step:
    """Gone: wait, however long it takes, for the same person and no other."""
    if now.sight in ("clear", "doubtful"):
        return acquiring(now, settings)
    if now.unsought and now.unseen_s > settings.hold_s and not now.looked_everywhere:
        return searching(now, settings)
    return "lost", "target lost"


_STATES: dict[FollowStateName, Callable[[Situation, FollowerSettings], Step]] = {
    "idle": acquiring,
    "acquiring": acquiring,
    "following": following,
    "occluded": occluded,
    "unsure": unsure,
    "searching": searching,
    "lost": lost,
    "stopped": acquiring,
}
