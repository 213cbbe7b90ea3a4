"""What `heel stop` says, and when `heel resume` refuses, by what was heard."""

from __future__ import annotations

import math

import pytest

from heel.schemas import DriveState, EStop, FollowState, Target
from heel.services.commands.robot_line import Heard
from heel.services.commands.stopping import is_released, is_stopped, refusal, told_of_stop
from heel.services.runtime.stop_socket import LocalAnswer

NOW_S = 100.0
TYPED_S = 99.0
ROUTER = "tcp/127.0.0.1:7447"


def drive(estop: bool, linear_mps: float = 0.0) -> DriveState:
    return DriveState(
        seq=1, state="stopped", reason="", estop=estop, driver="log", linear_mps=linear_mps,
        angular_radps=0.0,
    )  # fmt: skip


def follower(estop: bool) -> FollowState:
    return FollowState(
        seq=1, state="stopped", reason="", estop=estop, target=Target(seq=0, mode="none"),
        linear_mps=0.0, angular_radps=0.0,
    )  # fmt: skip


def heard(
    *drives: bool, following: bool | None = None, ago_s: float = 0.0, alive: str = ""
) -> Heard:
    return Heard(
        connected=True,
        drives={f"drive/main@{n:08x}": (drive(e), NOW_S - ago_s) for n, e in enumerate(drives)},
        follower=None if following is None else (follower(following), NOW_S - ago_s),
        alive=set(alive.split()),
        engagements={"a": EStop(engaged=True, source="", id="a")},
    )


HERE_STANDS, HERE_ROLLS = LocalAnswer(7, drive(True)), LocalAnswer(7, drive(False))
HERE_HANGS = LocalAnswer(7, None)


@pytest.mark.parametrize(
    ("said", "here", "words", "failed"),
    [
        (heard(True, following=True), [], "the wheels stand", False),
        (heard(True), [], "no follower answers", False),
        (heard(False, following=True), [], "does not stop", True),
        (heard(True, False), [], "not every drive confirms: drive/main@00000001", True),
        (heard(True, following=True, ago_s=5.0), [], "NOT stopped: no drive and no", True),
        (heard(False), [HERE_STANDS], "says that it does not stop: drive/main@0", False),
        (heard(True), [HERE_ROLLS], "does not stop", True),
        (heard(True), [HERE_HANGS], "the drive hangs (process 7)", True),
        (heard(following=True), [], "the robot's own end has to obey", False),
        (heard(following=True, alive="drive follower"), [], "the drive does not confirm", True),
        (heard(following=False), [], "NOT stopped: the follower answers", True),
        (heard(), [], "no drive and no follower answers", True),
        (Heard(), [], f"no Zenoh router at {ROUTER} answers within 2 s", True),
        (Heard(failure="wrong password"), [], "NOT stopped: wrong password", True),
        (Heard(), [HERE_STANDS], "(the router does not answer)", False),
    ],
)
def test_a_stop_says_what_is_true(
    said: Heard, here: list[LocalAnswer], words: str, failed: bool
) -> None:
    told, did_fail = told_of_stop(said, here, ROUTER, NOW_S)
    assert words in told
    assert did_fail == failed
    assert told.startswith("stopped: ") != failed


def test_a_drive_that_brakes_is_said_to() -> None:
    braking = LocalAnswer(7, drive(True, linear_mps=0.4))
    assert "the drive brakes" in told_of_stop(Heard(), [braking], ROUTER, NOW_S)[0]


def test_without_a_drive_the_follower_confirms() -> None:
    assert is_stopped(heard(following=True, alive="follower"), NOW_S)
    assert not is_stopped(heard(following=True, alive="follower drive"), NOW_S)
    assert not is_stopped(heard(following=True), NOW_S), "not known yet who is there"


@pytest.mark.parametrize(
    ("said", "here", "alone", "words"),
    [
        (heard(True, following=True), [HERE_STANDS], False, ""),
        (heard(True, following=True), [], False, ""),
        (heard(following=True), [], False, ""),
        (heard(True, following=True), [HERE_HANGS], False, "the drive does not answer"),
        (heard(following=True, alive="drive"), [], False, "the drive does not answer"),
        (heard(True), [HERE_STANDS], False, "no follower answers"),
        (heard(True), [HERE_STANDS], True, ""),
        (heard(True, alive="follower"), [], True, "no follower answers"),
        (Heard(connected=True), [], True, "no drive and no follower answers"),
        (Heard(), [HERE_STANDS], False, f"no Zenoh router at {ROUTER} answers"),
    ],
)
def test_nothing_is_released_unless_everybody_answers(
    said: Heard, here: list[LocalAnswer], alone: bool, words: str
) -> None:
    why = refusal(said, here, ROUTER, alone, TYPED_S, NOW_S)
    assert words in why
    assert bool(why) == bool(words)


def test_a_release_waits_for_the_id_of_the_engagement() -> None:
    said = heard(True, following=True)
    said.engagements.clear()
    assert "which engagement" in refusal(said, [], ROUTER, False, TYPED_S, NOW_S)
    assert refusal(heard(False, following=False), [], ROUTER, False, TYPED_S, NOW_S) == ""


@pytest.mark.parametrize(
    ("since_s", "released"), [(-math.inf, True), (TYPED_S - 0.1, True), (TYPED_S + 0.1, False)]
)
def test_a_stop_that_holds_since_after_the_release_was_typed_stays(
    since_s: float, released: bool
) -> None:
    said = heard(True, following=True)
    said.held_since_s["a"] = since_s
    assert (refusal(said, [], ROUTER, False, TYPED_S, NOW_S) == "") == released


@pytest.mark.parametrize(
    ("said", "released"),
    [
        (heard(False, following=False), True),
        (heard(True, following=False), False),
        (heard(False, following=True), False),
        (heard(False), False),
        (heard(following=False), False),
        (heard(False, following=False, ago_s=5.0), False),
    ],
)
def test_released_is_what_drive_and_follower_say(said: Heard, released: bool) -> None:
    assert is_released(said, True, True, NOW_S) == released
