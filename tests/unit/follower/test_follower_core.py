"""Whom the robot follows, and when it must not move."""

from __future__ import annotations

import math
from typing import Any

import pytest

from heel.schemas import HeelError, MotionCommand, Odometry, TargetRequest, Track, Tracks
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerSettings
from heel.services.follower.target import TargetError
from tests.unit.follower.people import OTHER_TRACKER, TRACKER, person, tracks
from tests.unit.follower.walking_world import INFO

FAR = 60.0
"""Box height of somebody several metres too far away."""


def follower(**settings: Any) -> Follower:
    return Follower(FollowerSettings.model_validate(settings))


def following(seen: Tracks | None = None, **settings: Any) -> Follower:
    """A follower that has chosen id 1 and seen it."""
    made = follower(**settings)
    made.observe(seen or tracks(person(1, height=FAR), person(2, x=100, height=FAR)), TRACKER)
    made.choose(TargetRequest(mode="id", track_id=1))
    return made


def drive(
    made: Follower, seconds: float = 2.0, age_s: float = 0.0, seen: Tracks | None = None
) -> MotionCommand:
    """Step at 50 Hz, the same picture seen again each time with a constant age; last command."""
    start_s = 10.0 if made._now_s is None else made._now_s
    seen = seen or made._tracks
    for i in range(max(1, round(seconds * 50)) + 1):
        if seen is not None and made._choice._tracker is not None:
            made.observe(seen, made._choice._tracker)
        command = made.step(start_s + i * 0.02, age_s)
    return command


def is_zero(command: MotionCommand) -> bool:
    return (command.linear_mps, command.angular_radps) == (0.0, 0.0)


def test_a_chosen_person_in_sight_is_followed() -> None:
    command = drive(following())
    assert command.state == "following"
    assert command.linear_mps > 0.3


@pytest.mark.parametrize(
    ("away_s", "ask_after_s", "asks"), [(3.0, 2.0, True), (1.5, 2.0, False), (3.0, 0.0, False)]
)
def test_who_is_back_after_long_is_followed_once_a_user_has_chosen_again(
    away_s: float, ask_after_s: float, asks: bool
) -> None:
    back = tracks(person(1, height=FAR))
    made = following(back, ask_after_s=ask_after_s)
    assert drive(made).state == "following"
    drive(made, away_s, seen=tracks())
    command = drive(made, seen=back)
    assert (command.state == "idle") == asks
    assert is_zero(command) == asks
    assert ("choose again" in command.reason) == asks
    assert (made.target.mode == "none") == asks
    made.choose(TargetRequest(mode="id", track_id=1))
    assert drive(made, seen=back).state == "following"


def test_what_is_not_proven_to_be_a_person_is_only_turned_to() -> None:
    thing = tracks(person(1, x=500.0, height=FAR, proven=False, identity_confidence=0.5))
    made = following(thing)
    commands = [drive(made, 0.0) for _ in range(150)]
    assert {command.state for command in commands} == {"acquiring"}
    assert {command.linear_mps for command in commands} == {0.0}
    assert commands[-1].angular_radps < -0.1
    assert "turning only" in commands[-1].reason
    gone = drive(made, seen=tracks())
    assert is_zero(gone)


def test_who_is_proven_after_a_time_in_sight_is_followed_at_once() -> None:
    made = following(tracks(person(1, height=FAR, proven=False, identity_confidence=0.6)))
    drive(made)
    assert drive(made, 0.0, seen=tracks(person(1, height=FAR))).state == "following"


def test_proof_lets_the_robot_drive_and_a_doubt_of_it_stops_it_at_once() -> None:
    made = following()
    assert drive(made).linear_mps > 0.3
    doubted = drive(made, 0.0, seen=tracks(person(1, height=FAR, proven=False)))
    assert (doubted.state, doubted.linear_mps) == ("acquiring", 0.0)
    assert drive(made, seen=tracks(person(1, height=FAR))).linear_mps > 0.3


def test_nobody_is_followed_unasked() -> None:
    made = follower()
    made.observe(tracks(person(height=FAR)), TRACKER)
    command = drive(made)
    assert (command.state, is_zero(command)) == ("idle", True)


def test_the_robot_turns_towards_the_person_left_is_positive() -> None:
    left = drive(following(tracks(person(1, x=200, height=FAR))))
    right = drive(following(tracks(person(1, x=440, height=FAR))))
    assert left.angular_radps > 0 > right.angular_radps
    assert left.angular_radps == pytest.approx(-right.angular_radps)


def test_nobody_is_run_into_and_only_who_may_reverse_backs_off() -> None:
    near = person(1, distance_m=1.0)
    assert drive(following(tracks(near))).linear_mps == 0.0
    assert drive(following(tracks(near), max_reverse_mps=0.3)).linear_mps == pytest.approx(
        -0.3, abs=1e-3
    )


def test_a_person_who_fills_the_picture_is_not_driven_at() -> None:
    cut_off = person(1, box_xyxy=(200.0, 0.0, 440.0, 480.0))
    assert drive(following(tracks(cut_off))).linear_mps == 0.0


def test_the_robot_turns_before_it_drives() -> None:
    ahead = drive(following(tracks(person(1, height=FAR))))
    aside = drive(following(tracks(person(1, height=FAR, bearing_rad=math.pi / 3, distance_m=9.0))))
    assert ahead.linear_mps > 0
    assert aside.linear_mps == 0.0
    assert aside.angular_radps > 0


def test_distance_and_bearing_of_the_track_win_over_the_box() -> None:
    command = drive(following(tracks(person(1, height=FAR, distance_m=1.5, bearing_rad=0.0))))
    assert is_zero(command)
    assert command.state == "following"


def test_a_stated_distance_that_jumps_away_is_not_raced_after() -> None:
    made = following(tracks(person(1, height=FAR, distance_m=1.8, bearing_rad=0.0)))
    drive(made)
    jumped = tracks(person(1, height=FAR, distance_m=6.0, bearing_rad=0.0), seq=1)
    drive(made, seconds=0.02, seen=jumped)
    assert made.state.distance_m is not None
    assert 1.7 < made.state.distance_m < 2.4


def test_a_wider_camera_sees_the_same_box_farther_aside() -> None:
    made = following(tracks(person(1, x=350, height=FAR)))
    narrow = drive(made).angular_radps
    made.set_camera(INFO.model_copy(update={"horizontal_fov_rad": 2.0}))
    assert abs(drive(made).angular_radps) > abs(narrow)


@pytest.mark.parametrize(
    ("change", "state"),
    [
        ({"identity_confidence": 0.59}, "unsure"),
        ({"identity_confidence": 0.0}, "unsure"),
        ({"identity_confidence": 0.9, "runner_up_confidence": 0.85}, "unsure"),
    ],
)
def test_doubt_about_the_person_stops_the_robot_at_once(change: dict[str, Any], state: str) -> None:
    made = following()
    assert drive(made).linear_mps > 0
    made.observe(tracks(person(1, height=FAR, **change), person(2)), TRACKER)
    command = drive(made, 0.0)
    assert (command.state, is_zero(command)) == (state, True)


@pytest.mark.parametrize(
    "change", [{"state": "occluded"}, {"state": "lost"}, {"shown": False}, {"id": 3}]
)
def test_who_is_out_of_sight_is_coasted_after_braked_for_searched_and_waited_for(
    change: dict[str, Any],
) -> None:
    made = following(tracks(person(1, x=250, height=FAR)), search_s=3.0)
    speed = drive(made).linear_mps
    gone = tracks(person(**{"track_id": 1, "height": FAR} | change), person(2, x=600))
    coasting = drive(made, 0.1, seen=gone)
    assert coasting.state == "occluded"
    assert 0.95 * speed < coasting.linear_mps <= speed, "no faster after a person out of sight"
    braking = drive(made, 0.5, seen=gone)
    assert braking.state == "occluded"
    assert 0 < braking.linear_mps < speed
    assert drive(made, 1.0, seen=gone).linear_mps == 0.0
    assert (made.state.state, made.state.angular_radps > 0) == ("searching", True)
    assert is_zero(drive(made, 3.0, seen=gone))
    assert (made.state.state, made.target.track_id) == ("lost", 1)
    assert is_zero(drive(made, 20.0, seen=gone))
    assert drive(made, seen=tracks(person(1, height=FAR))).state == "following"


def test_who_is_back_is_made_sure_of_before_the_robot_moves() -> None:
    made = following(confirm_s=0.2, search_s=0.0)
    drive(made)
    drive(made, 2.0, seen=tracks())
    back = tracks(person(1, height=FAR))
    command = drive(made, 0.1, seen=back)
    assert (command.state, is_zero(command)) == ("acquiring", True)
    assert drive(made, 0.2, seen=back).state == "following"


def test_who_was_doubtful_has_to_be_surer_than_who_was_not() -> None:
    made = following()
    drive(made)
    assert drive(made, seen=tracks(person(1, height=FAR, identity_confidence=0.65))).state == (
        "following"
    )
    drive(made, 0.1, seen=tracks(person(1, height=FAR, identity_confidence=0.5)))
    assert drive(made, seen=tracks(person(1, height=FAR, identity_confidence=0.65))).state == (
        "unsure"
    )
    assert drive(made, seen=tracks(person(1, height=FAR, identity_confidence=0.7))).state == (
        "following"
    )


@pytest.mark.parametrize("age_s", [0.31, 5.0, 1e6, math.nextafter(0.3, 1)])
def test_stops_when_tracks_are_stale(age_s: float) -> None:
    made = following(max_tracks_age_s=0.3)
    assert drive(made, age_s=0.3).linear_mps > 0
    command = drive(made, 0.0, age_s)
    assert (command.state, is_zero(command)) == ("lost", True)
    assert "older than 0.3 s" in command.reason


def gap(made: Follower, seconds: float = 2.0) -> None:
    """No tracks come for so long."""
    start_s = 10.0 if made._now_s is None else made._now_s
    for i in range(round(50 * seconds)):
        made.step(start_s + i * 0.02, i * 0.02)


def test_who_is_gone_after_a_gap_is_looked_for_once_and_then_waited_for() -> None:
    made = following(tracks(person(1, x=250, height=FAR)), search_s=3.0)
    assert drive(made).state == "following"
    gap(made)
    assert made.state.reason.startswith("tracks are older")
    gone = tracks(person(2, x=600))
    drive(made, 0.5, seen=gone)
    assert (made.state.state, made.state.angular_radps > 0) == ("searching", True)
    assert is_zero(drive(made, 3.0, seen=gone))
    assert (made.state.state, made.target.track_id) == ("lost", 1)
    gap(made)
    drive(made, 2.0, seen=gone)
    assert (made.state.state, made.state.angular_radps) == ("lost", 0.0)


def test_who_is_gone_after_a_gap_is_not_looked_for_once_the_robot_was_stopped() -> None:
    made = following(tracks(person(1, x=250, height=FAR)), search_s=3.0)
    drive(made)
    gap(made)
    made.set_estop(True)
    drive(made, 0.1, seen=tracks())
    made.set_estop(False)
    drive(made, 2.0, seen=tracks())
    assert (made.state.state, made.state.angular_radps) == ("lost", 0.0)


def test_who_is_in_sight_after_a_gap_is_made_sure_of_as_anybody_who_is_back() -> None:
    made = following(confirm_s=1.0, max_tracks_age_s=0.3)
    assert drive(made).state == "following"
    gap(made)
    states = [drive(made, 0.0).state for _ in range(60)]
    assert made.state.state == "following"
    assert 1.0 <= 0.02 * states.index("following") <= 1.1


def test_stops_before_the_first_tracks() -> None:
    made = follower(target="nearest")
    command = made.step(0.0, None)
    assert (command.state, command.frame, is_zero(command)) == ("acquiring", None, True)


def test_the_emergency_stop_wins_until_it_is_released() -> None:
    made = following()
    drive(made)
    made.set_estop(True)
    command = drive(made, 0.0)
    assert (command.state, is_zero(command), made.state.estop) == ("stopped", True, True)
    made.choose(TargetRequest(mode="id", track_id=2))
    assert is_zero(drive(made))
    made.set_estop(False)
    made.choose(TargetRequest(mode="id", track_id=1))
    assert drive(made).linear_mps > 0


def test_after_a_stop_the_robot_starts_from_standstill() -> None:
    made = following(max_linear_mps2=0.5)
    drive(made)
    made.set_estop(True)
    drive(made, 0.0)
    made.set_estop(False)
    drive(made, 0.02)
    assert 0 < drive(made, 0.02).linear_mps <= 0.5 * 0.02 * 4


@pytest.mark.parametrize(
    ("request_", "track_id"),
    [
        (TargetRequest(mode="id", track_id=2), 2),
        (TargetRequest(mode="id", track_id=2, tracker=TRACKER), 2),
        (TargetRequest(mode="point", x_px=100, y_px=390), 2),
        (TargetRequest(mode="nearest"), 3),
        (TargetRequest(mode="none"), None),
    ],
    ids=lambda value: getattr(value, "mode", ""),
)
def test_targets_are_chosen_by_id_point_and_nearness(
    request_: TargetRequest, track_id: int | None
) -> None:
    made = following(
        tracks(person(1), person(2, x=100), person(3, x=500, height=300.0), person(4, height=350.0,
               state="occluded"))
    )  # fmt: skip
    seq = made.target.seq
    assert made.choose(request_).track_id == track_id
    assert made.target.seq == seq + 1
    assert made.target.tracker == (None if track_id is None else TRACKER)


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (TargetRequest(mode="id", track_id=9), "nobody has id 9"),
        (TargetRequest(mode="id", track_id=1, tracker=OTHER_TRACKER), OTHER_TRACKER),
        (TargetRequest(mode="point", x_px=641, y_px=5), "(641, 5) is outside the picture"),
    ],
    ids=["unknown id", "id of another tracker", "outside"],
)
def test_targets_that_are_not_there_are_refused_and_the_old_one_stays(
    request_: TargetRequest, words: str
) -> None:
    made = following(tracks(person(1), person(3, x=500, shown=False)))
    before = made.target
    with pytest.raises(TargetError) as error:
        made.choose(request_)
    assert words in str(error.value)
    assert isinstance(error.value, HeelError)
    assert made.target == before


def test_nearest_waits_for_somebody_and_then_stays_with_them() -> None:
    made = follower(target="nearest")
    made.observe(tracks(), TRACKER)
    assert drive(made, 0.5).state == "acquiring"
    made.observe(tracks(person(5, height=FAR)), TRACKER)
    assert drive(made).state == "following"
    made.observe(tracks(person(5, height=FAR), person(6, height=300.0)), TRACKER)
    drive(made)
    assert made.target.track_id == 5


def test_where_nobody_is_in_view_the_nearest_is_looked_for_by_one_turn_on_the_spot() -> None:
    made, turned_rad = follower(target="nearest"), 0.0
    made.observe(tracks(), TRACKER)
    for _ in range(900):
        command = drive(made, 0.0)
        assert command.linear_mps == 0.0
        turned_rad += 0.02 * command.angular_radps
    assert turned_rad == pytest.approx(2 * math.pi, abs=0.5)
    assert (command.state, is_zero(command)) == ("acquiring", True)
    assert "waiting for the first person" in command.reason
    made.choose(TargetRequest(mode="nearest"))
    assert drive(made).angular_radps > 0, "asked again it looks again"


@pytest.mark.parametrize("settings", [{"target": "imprint"}, {"target": "nearest", "search_s": 0}])
def test_a_robot_that_waits_for_somebody_to_come_before_it_stands(settings: dict[str, Any]) -> None:
    made = follower(**settings)
    made.observe(tracks(), TRACKER)
    assert is_zero(drive(made, 3.0))


def test_looking_around_ends_in_time_where_the_wheels_do_not_turn() -> None:
    made = follower(target="nearest", search_s=3.0)
    made.observe(tracks(), TRACKER)
    still = Odometry(seq=0, x_m=0, y_m=0, heading_rad=0, linear_mps=0, angular_radps=0)
    for step in range(300):
        made.observe_odometry(still.model_copy(update={"seq": step}), made._now_s or 10.0)
        command = drive(made, 0.0)
    assert (command.state, is_zero(command)) == ("acquiring", True)


def test_a_replaced_tracker_makes_the_chosen_id_void() -> None:
    made = following()
    drive(made)
    made.observe(tracks(person(1, height=FAR)), OTHER_TRACKER)
    command = drive(made)
    assert (command.state, is_zero(command)) == ("idle", True)
    assert "choose again" in command.reason


def test_commands_are_numbered_and_name_the_frame_they_rest_on() -> None:
    made = following(tracks(person(1), seq=41))
    commands = [made.step(i * 0.02, 0.0) for i in range(3)]
    assert [command.seq for command in commands] == [0, 1, 2]
    frame = commands[-1].frame
    assert frame is not None
    assert (frame.stream, frame.epoch, frame.seq) == ("front", 1, 41)


def test_the_same_tracks_give_the_same_commands() -> None:
    def run() -> list[MotionCommand]:
        made = following()
        return [made.step(i * 0.02, 0.01 * (i % 40)) for i in range(200)]

    assert run() == run()


@pytest.mark.parametrize(
    ("seen", "expected"),
    [
        (person(1, height=FAR), "speed limit"),
        (person(1, distance_m=1.6), "at the wished distance"),
        (person(1, distance_m=1.0), "nearer than wished"),
        (person(1, distance_m=2.5, bearing_rad=0.7), "turning first"),
    ],
)
def test_the_state_says_what_bounds_the_speed(seen: Track, expected: str) -> None:
    made = following(tracks(seen))
    drive(made, 0.4)
    assert made.state.speed_reason.endswith(expected)


def test_somebody_in_the_way_and_nothing_that_moves_are_told_apart() -> None:
    made = following(
        tracks(person(1, height=FAR), person(2, x=90, distance_m=1.3, bearing_rad=0.0))
    )
    drive(made)
    assert made.state.speed_reason == "somebody else is in the way"
    made.set_estop(True)
    drive(made, 0.1)
    assert made.state.speed_reason == ""


def test_the_state_tells_how_likely_somebody_else_is_the_target() -> None:
    made = following(tracks(person(1, runner_up_confidence=0.25)))
    drive(made)
    assert made.state.runner_up_confidence == 0.25
