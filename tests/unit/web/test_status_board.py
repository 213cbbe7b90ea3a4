from __future__ import annotations

import json

from heel.schemas import DriveState, EndOfStream, Health, MotionCommand, TrackEvent
from heel.services.runtime.chain import MAX_PARTS
from heel.services.web.status import StatusBoard
from tests.unit.web.web_builders import TRACKER, follow_state, header


def health(service: str, instance: str = "main") -> Health:
    return Health(
        service=service, instance=instance, producer=f"{service}/{instance}@0123abcd",
        state="ok", uptime_s=1.0, loop_age_s=0.0, software_version="1",
    )  # fmt: skip


def test_ages_grow_while_nothing_comes() -> None:
    board = StatusBoard("front", 1.0)
    assert board.compose(5.0)["picture"]["age_s"] is None
    board.image(header(0), 5.0)
    board.tracks(5.1)
    board.health(health("tracker"), 5.0)
    board.command(
        MotionCommand(seq=0, linear_mps=0.2, angular_radps=0.1, ttl_s=0.5, state="following",
                      reason="x"), 5.5)  # fmt: skip
    status = board.compose(6.2)
    assert status["picture"]["age_s"] == 1.2
    assert status["picture"]["tracks_age_s"] == 1.1
    assert status["command"]["age_s"] == 0.7
    assert status["services"][0]["silent_s"] == 1.2


def test_an_ended_stream_stays_ended_until_another_begins() -> None:
    board = StatusBoard("front", 1.0)
    board.image(header(9, epoch=1), 1.0)
    board.end(EndOfStream(stream="front", epoch=1, frames=10, reason="end of file"))
    assert board.compose(2.0)["picture"]["ended"] == {"frames": 10, "reason": "end of file"}
    board.image(header(9, epoch=1), 2.0)
    assert board.has_ended
    board.image(header(0, epoch=2), 3.0)
    assert not board.has_ended


def test_services_are_bounded_and_forgotten() -> None:
    board = StatusBoard("front", 1.0)
    board.health(health("tracker"), 0.0)
    for n in range(100):
        board.health(health(f"x{n}"), 0.1)
        board.health(health("drive", f"i{n}"), 0.1)
    rows = board.compose(0.2)["services"]
    assert len(rows) <= MAX_PARTS
    assert rows[0]["service"] == "tracker", "the chain's own stay, in the chain's order"
    assert board.compose(0.2)["unlisted"] > 100
    assert board.compose(100.0)["services"] == []


def test_a_notice_is_its_senders_and_one_line() -> None:
    board = StatusBoard("front", 1.0)
    hostile = "update\x1b[2J\nnow" + "x" * 500
    for n in range(9):
        board.health(health(f"x{n}").model_copy(update={"details": {"notice": hostile}}), 1.0)
    board.health(health("simulator").model_copy(update={"details": {"notice": "boxes"}}), 1.0)
    notices = board.compose(1.1)["notices"]
    assert notices[0] == {"service": "simulator", "text": "boxes"}
    assert len(notices) == 3
    assert notices[1]["service"].startswith("x")
    assert notices[1]["text"].isprintable()
    assert len(notices[1]["text"]) <= 200
    assert board.compose(9.0)["notices"] == []


def test_what_the_follower_knows_is_passed_on() -> None:
    board = StatusBoard("front", 1.0)
    board.follower = follow_state(3, "tracker/main@0123abcd").model_copy(
        update={"distance_m": 1.5, "identity_confidence": 0.9, "runner_up_confidence": 0.2,
                "speed_reason": "at distance", "obstacle_watch": True, "free_distance_m": 3.0,
                "pending_point_px": (3.0, 4.0)}
    )  # fmt: skip
    told = board.compose(1.0)["follower"]
    assert (told["distance_m"], told["runner_up_confidence"]) == (1.5, 0.2)
    assert (told["speed_reason"], told["obstacle_watch"]) == ("at distance", True)
    assert told["pending_point_px"] == [3.0, 4.0]


def drive(estop: bool) -> DriveState:
    return DriveState(
        seq=1, state="stopped", reason="emergency stop", estop=estop, driver="log",
        linear_mps=0.0, angular_radps=0.0,
    )  # fmt: skip


def test_a_stop_is_confirmed_by_the_drive_wherever_one_was_heard() -> None:
    board = StatusBoard("front", 1.0)
    board.follow(follow_state(estop=True), 0.9)
    assert board.stop(True, 1.0) == {"confirmed_by": "follower", "unconfirmed_s": None}
    assert board.stop(True, 1.95)["confirmed_by"] is None, "nor does a follower"
    board.stop(False, 1.96)
    board.drive(drive(estop=False), 2.0)
    assert board.stop(True, 2.1) == {"confirmed_by": None, "unconfirmed_s": 0.0}
    assert board.stop(True, 3.2)["unconfirmed_s"] == 1.1
    board.drive(drive(estop=True), 3.3)
    assert board.stop(True, 3.4) == {"confirmed_by": "drive", "unconfirmed_s": None}
    assert board.stop(True, 9.0)["confirmed_by"] is None, (
        "a drive that fell silent confirms nothing"
    )
    assert board.stop(False, 9.1) == {"confirmed_by": None, "unconfirmed_s": None}


def test_problems_are_told_and_not_those_of_a_stream_that_has_ended() -> None:
    board = StatusBoard("front", 1.0)
    board.health(health("tracker").model_copy(update={"period_s": 0.25}), 0.0)
    board.health(health("drive").model_copy(update={"period_s": 0.25}), 3.0)
    assert [one.words for one in board.problems(3.0)] == ["tracker: silent for 3 s"]
    board.image(header(9, epoch=1), 1.0)
    board.end(EndOfStream(stream="front", epoch=1, frames=10, reason="end of file"))
    assert board.problems(3.0) == []


def test_status_is_plain_json() -> None:
    board = StatusBoard("front", 1.0)
    board.follow(follow_state(3, "tracker/main@0123abcd"), 0.0)
    board.health(health("tracker"), 1.0)
    status = board.compose(1.0)
    assert json.loads(json.dumps(status)) == status
    assert status["follower"]["target"]["track_id"] == 3


def event(text: str, *ids: int) -> TrackEvent:
    return TrackEvent(frame=header(0).frame_id(), kind="unsure", ids=ids, text=text)


def test_the_story_is_the_targets_own_and_the_newest_first() -> None:
    board = StatusBoard("front", 1.0)
    board.event(event("id 7 met id 4", 7, 4), TRACKER, 1.0)
    board.event(event("id 4 is unsure", 4), TRACKER, 2.0)
    board.event(event("another tracker's 7", 7), "tracker/other@00000001", 2.0)
    board.event(event("id 9 was id 7", 9, 7), TRACKER, 3.0)
    assert board.compose(4.0)["story"] == [], "nobody is followed"
    board.follow(follow_state(7, TRACKER), 0.0)
    assert board.compose(4.0)["story"] == [
        {"text": "id 9 was id 7", "age_s": 1.0}, {"text": "id 7 met id 4", "age_s": 3.0},
    ]  # fmt: skip
    for number in range(500):
        board.event(event(f"{number} \x1b[2J" + "x" * 280, 7), TRACKER, 5.0)
    story = board.compose(5.0)["story"]
    assert [line["text"].split()[0] for line in story] == ["499", "498", "497", "496"]
    assert len(json.dumps(story)) < 2000
    assert "\x1b" not in story[0]["text"]
