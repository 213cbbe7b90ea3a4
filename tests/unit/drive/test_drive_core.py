"""Which commands move the wheels, how fast, and what makes them stand."""

from __future__ import annotations

import itertools

import pytest

from heel.schemas import DriveState, MotionCommand
from heel.services.drive.core import Drive
from heel.services.drive.settings import DriveSettings
from heel.services.runtime.streams import PRODUCER_STALE_S

FOLLOWER, OTHER = "follower/main@00000001", "follower/main@00000002"


def command(
    linear_mps: float = 0.5, angular_radps: float = 0.0, seq: int = 0, ttl_s: float = 0.5
) -> MotionCommand:
    return MotionCommand(
        seq=seq, linear_mps=linear_mps, angular_radps=angular_radps, ttl_s=ttl_s,
        state="following", reason="target in sight",
    )  # fmt: skip


def driving(drive: Drive, linear_mps: float = 0.5, angular_radps: float = 0.0) -> float:
    """Drive for a second; when the last command came."""
    for seq in range(50):
        now_s = 10.0 + seq * 0.02
        drive.take(command(linear_mps, angular_radps, seq), FOLLOWER, now_s)
        drive.step(now_s)
    return now_s


def told(state: DriveState) -> tuple[str, float, float]:
    return state.state, state.linear_mps, state.angular_radps


def test_without_a_command_the_wheels_wait() -> None:
    state = Drive(DriveSettings()).step(1.0)
    assert told(state) == ("waiting", 0.0, 0.0)
    assert (state.reason, state.command_seq, state.command_age_s) == ("no command yet", None, None)


def test_a_fresh_command_is_reached_and_named() -> None:
    drive = Drive(DriveSettings())
    last_s = driving(drive, 0.5, -1.0)
    state = drive.step(last_s + 0.02)
    assert told(state) == ("driving", 0.5, -1.0)
    assert (state.reason, state.command_seq) == ("target in sight", 49)
    assert state.command_age_s == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("own_ttl_s", "command_ttl_s", "after_s", "moves"),
    [
        (0.5, 0.5, 0.49, True),
        (0.5, 0.5, 0.51, False),
        (0.5, 0.2, 0.19, True),
        (0.5, 0.2, 0.21, False),
        (0.1, 0.5, 0.09, True),
        (0.1, 0.5, 0.11, False),
    ],
)
def test_the_shorter_time_to_live_ends_a_command(
    own_ttl_s: float, command_ttl_s: float, after_s: float, moves: bool
) -> None:
    drive = Drive(DriveSettings(ttl_s=own_ttl_s))
    drive.take(command(ttl_s=command_ttl_s), FOLLOWER, 10.0)
    drive.step(10.0)
    drive.step(10.01)
    state = drive.step(10.0 + after_s)
    assert (state.state == "driving") == moves
    assert moves or state.reason == f"no command for {min(own_ttl_s, command_ttl_s):g} s"


def test_a_command_that_ran_out_does_not_come_back_with_the_clock() -> None:
    drive = Drive(DriveSettings())
    last_s = driving(drive)
    assert drive.step(last_s + 1.0).state == "stopped"
    assert drive.step(last_s).state == "stopped"


@pytest.mark.parametrize(
    ("asked", "allowed"),
    [
        ((5.0, 10.0), (0.9, 1.5)),
        ((-5.0, -10.0), (-0.3, -1.5)),
        ((0.3, -0.2), (0.3, -0.2)),
    ],
)
def test_speed_limits_hold_whatever_is_asked(
    asked: tuple[float, float], allowed: tuple[float, float]
) -> None:
    drive = Drive(DriveSettings(max_linear_mps=0.9, max_reverse_mps=0.3, max_angular_radps=1.5))
    driving(drive, *asked)
    assert told(drive.step(11.0)) == ("driving", *allowed)


def test_speeding_up_is_limited_also_when_a_step_comes_late() -> None:
    drive = Drive(DriveSettings(max_linear_mps2=1.0, max_angular_radps2=2.0, ttl_s=2.0))
    drive.step(10.0)
    drive.take(command(1.0, 1.0, ttl_s=2.0), FOLLOWER, 10.0)
    first = drive.step(10.1)
    assert (first.linear_mps, first.angular_radps) == pytest.approx((0.1, 0.2))
    late = drive.step(11.1)
    assert (late.linear_mps, late.angular_radps) == pytest.approx((0.3, 0.6))


def test_turning_round_passes_through_zero() -> None:
    drive = Drive(DriveSettings(max_linear_mps2=1.0))
    last_s = driving(drive, 0.3)
    drive.take(command(-0.3, seq=50), FOLLOWER, last_s)
    speeds = [drive.step(last_s + step * 0.02).linear_mps for step in (1, 2, 3)]
    assert speeds == pytest.approx([0.0, -0.02, -0.04])


STOPS = {
    "zero command": lambda drive, now_s: drive.take(command(0.0, 0.0, 50), FOLLOWER, now_s),
    "emergency stop": lambda drive, now_s: drive.set_estop(True),
    "end of stream": lambda drive, now_s: drive.end(),
}


@pytest.mark.parametrize("stop", STOPS.values(), ids=STOPS.keys())
def test_every_stop_is_zero_at_once(stop: object) -> None:
    drive = Drive(DriveSettings(max_linear_mps2=0.1, max_angular_radps2=0.1))
    last_s = driving(drive, 1.0, 1.0)
    assert callable(stop)
    stop(drive, last_s)
    assert told(drive.step(last_s)) == ("stopped", 0.0, 0.0)


@pytest.mark.parametrize("stop", STOPS.values(), ids=STOPS.keys())
def test_braking_takes_the_time_that_was_asked_for_and_turning_none(stop: object) -> None:
    drive = Drive(DriveSettings(braking_mps2=1.0))
    last_s = driving(drive, 1.0, 1.0)
    assert callable(stop)
    stop(drive, last_s)
    half = drive.step(last_s + 0.5)
    assert told(half) == ("driving", pytest.approx(0.5), 0.0)
    assert half.reason.startswith("braking: ")
    assert told(drive.step(last_s + 1.0)) == ("stopped", 0.0, 0.0)


def test_the_end_of_the_drive_is_zero_whatever_braking_is_set() -> None:
    drive = Drive(DriveSettings(braking_mps2=0.1))
    last_s = driving(drive, 1.0, 1.0)
    state = drive.halt("the drive ends", last_s)
    assert told(state) == ("stopped", 0.0, 0.0)
    assert state.reason == "the drive ends"


def test_after_an_emergency_stop_only_a_new_command_moves() -> None:
    drive = Drive(DriveSettings())
    last_s = driving(drive)
    drive.set_estop(True)
    drive.take(command(seq=50), FOLLOWER, last_s)
    held = drive.step(last_s)
    assert (*told(held), held.estop, held.reason) == ("stopped", 0.0, 0.0, True, "emergency stop")
    drive.set_estop(False)
    assert told(drive.step(last_s)) == ("stopped", 0.0, 0.0)
    drive.take(command(seq=51), FOLLOWER, last_s)
    assert drive.step(last_s + 0.02).state == "driving"


@pytest.mark.parametrize(
    ("seq", "producer", "after_s", "taken"),
    [
        (50, FOLLOWER, 0.02, True),
        (49, FOLLOWER, 0.02, False),
        (3, FOLLOWER, 0.02, False),
        (50, OTHER, 0.02, False),
        (0, OTHER, PRODUCER_STALE_S + 0.01, True),
        (3, FOLLOWER, PRODUCER_STALE_S + 0.01, False),
    ],
    ids=["next", "again", "old", "rival", "successor", "old after a silence"],
)
def test_one_producer_is_obeyed_in_its_order(
    seq: int, producer: str, after_s: float, taken: bool
) -> None:
    drive = Drive(DriveSettings())
    last_s = driving(drive, 0.2)
    for step in range(1, round(after_s / 0.02)):
        drive.step(last_s + step * 0.02)
    assert drive.take(command(0.7, seq=seq), producer, last_s + after_s) == taken
    state = drive.step(last_s + after_s)
    assert (state.command_seq == seq) == (taken or seq == 49)


def test_a_recording_of_a_dead_follower_neither_drives_nor_stops_the_next_one() -> None:
    drive = Drive(DriveSettings())
    last_s = driving(drive, 0.9)
    for tick in range(1, 150):
        now_s = last_s + 0.1 * tick
        drive.step(now_s)
        assert drive.take(command(0.1, seq=tick), OTHER, now_s) == (tick > 5)
        if tick > 5:
            assert not drive.take(command(0.9, seq=tick % 50), FOLLOWER, now_s + 0.05)


def test_a_refused_command_does_not_prolong_the_last_one() -> None:
    drive = Drive(DriveSettings())
    last_s = driving(drive)
    for step in range(1, 26):
        drive.take(command(seq=10), FOLLOWER, last_s + step * 0.02)
        drive.take(command(seq=100), OTHER, last_s + step * 0.02)
    assert drive.step(last_s + 0.5).state == "stopped"


def test_after_a_hang_the_drive_starts_from_standing_without_what_waited() -> None:
    drive = Drive(DriveSettings())
    back_s = driving(drive, 1.8) + 3.0
    assert not drive.take(command(1.8, seq=100), FOLLOWER, back_s), "it waited"
    state = drive.step(back_s)
    assert told(state) == ("stopped", 0.0, 0.0)
    assert state.reason == "the drive hung for 3.0 s"
    assert not drive.take(command(1.8, seq=101), FOLLOWER, back_s + 0.01), "so did this"
    speeds = []
    for step in range(8, 20):
        drive.take(command(1.8, seq=100 + step), FOLLOWER, back_s + step * 0.02)
        speeds.append(drive.step(back_s + step * 0.02).linear_mps)
    steps = [after - before for before, after in itertools.pairwise(speeds)]
    assert speeds[-1] > 0.3
    assert max(steps) <= 2.0 * 0.02 + 1e-9, "within the limit on acceleration"


def test_a_hang_does_not_release_an_emergency_stop() -> None:
    drive = Drive(DriveSettings())
    last_s = driving(drive)
    drive.set_estop(True)
    assert drive.step(last_s + 3.0).estop


def test_what_is_told_is_numbered() -> None:
    drive = Drive(DriveSettings(driver="simulated"))
    states = [drive.step(10.0 + step * 0.02) for step in range(3)]
    assert [state.seq for state in states] == [0, 1, 2]
    assert {state.driver for state in states} == {"simulated"}
