"""Every state, every way out of it, and what overrules them all."""

from __future__ import annotations

from dataclasses import replace

import pytest

from heel.schemas.follow import FollowStateName
from heel.services.follower.settings import FollowerSettings
from heel.services.follower.sight import judge_sight
from heel.services.follower.states import Situation, next_state
from tests.unit.follower.people import person

SETTINGS = FollowerSettings(confirm_s=0.2, hold_s=1.0, search_s=10.0, max_tracks_age_s=0.25)
CLEAR = Situation(
    estop=False, ranges_stale=False, chosen=True, chosen_reason="chosen", target_id=1,
    tracks_age_s=0.05, sight="clear", sight_reason="target in sight", clear_s=1.0, unseen_s=0.05,
    searching_s=0.0, looked_everywhere=False,
)  # fmt: skip
FRESHLY_CLEAR = replace(CLEAR, clear_s=0.1)
DOUBTFUL = replace(CLEAR, sight="doubtful", sight_reason="identity unsure", clear_s=0.0)
HIDDEN = replace(CLEAR, sight="hidden", sight_reason="target occluded", clear_s=0.0)
MISSED = replace(CLEAR, sight="missed", sight_reason="target missed", clear_s=0.0)
GONE = replace(MISSED, unseen_s=1.5)
UNSOUGHT = replace(GONE, unsought=True)
LONG_SEARCHED = replace(GONE, unseen_s=12.0, searching_s=10.0)
BEHIND_A_THING = replace(GONE, on_way=True)
SEARCHED_ROUND = replace(GONE, unseen_s=5.0, searching_s=4.0, looked_everywhere=True)

ALL: tuple[FollowStateName, ...] = (
    "idle", "acquiring", "following", "occluded", "unsure", "searching", "lost", "stopped",
)  # fmt: skip


@pytest.mark.parametrize(
    ("present", "situation", "expected", "reason"),
    [
        ("idle", FRESHLY_CLEAR, "acquiring", "making sure"),
        ("idle", CLEAR, "following", "target in sight"),
        ("acquiring", FRESHLY_CLEAR, "acquiring", "making sure"),
        ("acquiring", CLEAR, "following", "target in sight"),
        ("acquiring", DOUBTFUL, "unsure", "identity unsure"),
        ("acquiring", HIDDEN, "acquiring", "target occluded"),
        ("acquiring", GONE, "lost", "target lost"),
        ("following", CLEAR, "following", "target in sight"),
        ("following", FRESHLY_CLEAR, "following", "target in sight"),
        ("following", DOUBTFUL, "unsure", "identity unsure"),
        ("following", HIDDEN, "occluded", "target occluded"),
        ("following", MISSED, "occluded", "target missed"),
        ("following", GONE, "searching", "looking where the target was last seen"),
        ("following", BEHIND_A_THING, "occluded", "hidden behind a thing: along the way they took"),
        ("occluded", BEHIND_A_THING, "occluded", "hidden behind a thing: along the way they took"),
        ("unsure", BEHIND_A_THING, "searching", "looking where the target was last seen"),
        ("occluded", FRESHLY_CLEAR, "following", "target in sight"),
        ("occluded", DOUBTFUL, "unsure", "identity unsure"),
        ("occluded", HIDDEN, "occluded", "target occluded"),
        ("occluded", GONE, "searching", "looking where the target was last seen"),
        ("unsure", FRESHLY_CLEAR, "unsure", "making sure"),
        ("unsure", CLEAR, "following", "target in sight"),
        ("unsure", DOUBTFUL, "unsure", "identity unsure"),
        ("unsure", HIDDEN, "unsure", "target occluded"),
        ("unsure", GONE, "searching", "looking where the target was last seen"),
        ("searching", FRESHLY_CLEAR, "acquiring", "making sure"),
        ("searching", DOUBTFUL, "unsure", "identity unsure"),
        ("searching", GONE, "searching", "looking where the target was last seen"),
        ("searching", LONG_SEARCHED, "lost", "target lost: not found within 10 s"),
        ("searching", SEARCHED_ROUND, "lost", "target lost: looked everywhere"),
        ("lost", FRESHLY_CLEAR, "acquiring", "making sure"),
        ("lost", DOUBTFUL, "unsure", "identity unsure"),
        ("lost", MISSED, "lost", "target lost"),
        ("lost", replace(GONE, unseen_s=1e6), "lost", "target lost"),
        ("lost", UNSOUGHT, "searching", "looking where the target was last seen"),
        ("lost", replace(MISSED, unsought=True), "lost", "target lost"),
        ("lost", replace(SEARCHED_ROUND, unsought=True), "lost", "target lost"),
        ("lost", replace(FRESHLY_CLEAR, unsought=True), "acquiring", "making sure"),
        ("stopped", FRESHLY_CLEAR, "acquiring", "making sure"),
        ("stopped", GONE, "lost", "target lost"),
    ],
)
def test_ways_from_state_to_state(
    present: FollowStateName, situation: Situation, expected: FollowStateName, reason: str
) -> None:
    assert next_state(present, situation, SETTINGS) == (expected, reason)


@pytest.mark.parametrize("present", ALL)
@pytest.mark.parametrize("sight", [CLEAR, DOUBTFUL, GONE])
@pytest.mark.parametrize(
    ("change", "expected", "reason"),
    [
        ({"estop": True, "ranges_stale": True, "chosen": False}, "stopped", "emergency stop"),
        ({"ranges_stale": True, "chosen": False}, "stopped", "ranges are older than 0.25 s"),
        ({"chosen": False, "chosen_reason": "cleared"}, "idle", "cleared"),
        ({"chosen": False, "chosen_reason": ""}, "idle", "no target"),
        ({"tracks_age_s": None}, "acquiring", "no tracks yet"),
        ({"stale": "tracks are old", "frozen": True}, "lost", "tracks are old"),
        (
            {"frozen": True},
            "stopped",
            "the picture does not move though the robot does: is the camera frozen?",
        ),
        ({"target_id": None, "chosen_reason": "waiting"}, "acquiring", "waiting"),
    ],
)
def test_what_overrules_every_state(
    present: FollowStateName, sight: Situation, change: dict[str, object],
    expected: FollowStateName, reason: str,
) -> None:  # fmt: skip
    situation = replace(sight, **change)  # type: ignore[arg-type]
    assert next_state(present, situation, SETTINGS) == (expected, reason)


def test_only_clear_sight_leads_to_following() -> None:
    for present in ALL:
        for situation in (DOUBTFUL, HIDDEN, MISSED, GONE, LONG_SEARCHED, SEARCHED_ROUND):
            assert next_state(present, situation, SETTINGS)[0] != "following"


@pytest.mark.parametrize(
    ("changes", "trusted", "expected"),
    [
        ({}, False, "clear"),
        ({"state": "occluded"}, True, "hidden"),
        ({"state": "lost"}, True, "missed"),
        ({"state": "new"}, True, "missed"),
        ({"shown": False}, True, "missed"),
        ({"identity_confidence": 0.65}, True, "clear"),
        ({"identity_confidence": 0.65}, False, "doubtful"),
        ({"identity_confidence": 0.55}, True, "doubtful"),
        ({"identity_confidence": 0.9, "runner_up_confidence": 0.75}, True, "clear"),
        ({"identity_confidence": 0.9, "runner_up_confidence": 0.75}, False, "doubtful"),
        ({"identity_confidence": 0.9, "runner_up_confidence": 0.85}, True, "doubtful"),
    ],
)
def test_sight_has_two_thresholds(changes: dict[str, object], trusted: bool, expected: str) -> None:
    assert judge_sight(person(1, **changes), True, trusted, SETTINGS)[0] == expected


def test_nobody_and_a_box_without_a_place_are_missed() -> None:
    assert judge_sight(None, True, True, SETTINGS)[0] == "missed"
    assert judge_sight(person(1), False, True, SETTINGS)[0] == "missed"
