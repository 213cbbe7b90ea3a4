"""Who drives, a hand or the follower: what no message and no silence may bring about."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError

from heel.schemas import (
    EStop,
    Manual,
    MessageError,
    Ranges,
    RangeSector,
    TargetRequest,
    decode,
    encode,
)
from heel.services.follower.core import Follower
from heel.services.follower.manual import ManualDrive, ManualError
from heel.services.follower.settings import FollowerSettings
from heel.services.follower.target import TargetError

GRANT, OTHER = "0123456789abcdef", "fedcba9876543210"
STEP_S = 0.02


def wish(seq: int, forward: float = 1.0, left: float = 0.0, **changed: object) -> Manual:
    fields = {"grant": GRANT, "seq": seq, "held": True, "forward": forward, "left": left,
              "ttl_s": 0.3}  # fmt: skip
    return Manual.model_validate(fields | changed)


class Robot:
    """A follower at 50 Hz, and a hand at 20 Hz while it holds."""

    def __init__(self, **settings: object) -> None:
        self.follower = Follower(FollowerSettings.model_validate(settings))
        self.now_s, self.seq = 100.0, 0

    def take(self, source: str = "hand") -> None:
        self.follower.take_by_hand(GRANT, source, self.now_s)

    def hold(self, seconds: float, forward: float = 1.0, left: float = 0.0) -> list[float]:
        """Speeds that were told while the hand held."""
        told = []
        for number in range(round(seconds / STEP_S)):
            if number % 3 == 0:
                self.follower.observe_wish(wish(self.seq, forward, left), self.now_s, self.now_s)
                self.seq += 1
            told.append(self.step())
        return told

    def step(self) -> float:
        self.now_s += STEP_S
        return self.follower.step(self.now_s, None).linear_mps

    def stand(self, seconds: float) -> list[float]:
        return [self.step() for _ in range(round(seconds / STEP_S))]


def test_the_robot_goes_as_the_hand_holds_and_stands_when_it_lets_go() -> None:
    robot = Robot()
    robot.take()
    assert robot.hold(1.0)[-1] == pytest.approx(0.5, abs=0.01)
    robot.follower.observe_wish(wish(robot.seq, held=False), robot.now_s, robot.now_s)
    assert robot.step() == 0.0, "at once"


def test_silence_of_the_hand_stops_the_robot_within_the_wishs_time() -> None:
    robot = Robot()
    robot.take()
    robot.hold(1.0)
    still = robot.stand(0.5)
    moving_s = STEP_S * sum(speed != 0 for speed in still)
    assert 0.1 < moving_s <= 0.3
    assert still[-1] == 0.0


def test_a_wish_is_as_old_as_it_is_told() -> None:
    robot = Robot()
    robot.take()
    assert robot.follower.observe_wish(wish(0), robot.now_s - 0.31, robot.now_s) == "0.31 s old"
    assert robot.stand(0.4) == [0.0] * 20
    assert not robot.follower.observe_wish(wish(1), robot.now_s - 0.2, robot.now_s)
    moving = sum(speed != 0 for speed in robot.stand(0.4))
    assert 0 < moving <= 5, "a tenth of a second is left of it"


def test_a_wish_from_the_future_holds_no_longer() -> None:
    robot = Robot()
    robot.take()
    robot.follower.observe_wish(wish(0), robot.now_s + 1e6, robot.now_s)
    robot.stand(0.32)
    assert robot.step() == 0.0


def test_a_replayed_wish_moves_nothing() -> None:
    robot = Robot()
    robot.take()
    robot.hold(1.0)
    robot.stand(1.0)
    for seq in range(robot.seq):
        assert robot.follower.observe_wish(wish(seq), robot.now_s, robot.now_s)
        assert robot.step() == 0.0


def test_wishes_of_an_earlier_driver_or_of_nobody_move_nothing() -> None:
    robot = Robot()
    assert robot.follower.observe_wish(wish(0), robot.now_s, robot.now_s)
    assert robot.step() == 0.0
    robot.take()
    robot.follower.take_by_hand(OTHER, "another", robot.now_s)
    assert robot.follower.observe_wish(wish(10**6), robot.now_s, robot.now_s)
    assert robot.stand(0.2) == [0.0] * 10
    robot.follower.hand_back(robot.now_s)
    assert robot.follower.observe_wish(wish(10**7, grant=OTHER), robot.now_s, robot.now_s)
    assert robot.stand(0.2) == [0.0] * 10


@pytest.mark.parametrize("value", [math.nan, math.inf, 1.0001, -2.0, "1", True, None])
def test_what_is_no_share_is_refused_before_it_gets_here(value: object) -> None:
    for name in ("forward", "left"):
        with pytest.raises(ValidationError):
            wish(0, **{name: value})
    with pytest.raises(ValidationError):
        wish(0, ttl_s=0.51)
    payload = bytearray(encode(wish(0, 0.25)))
    at = payload.find(b"\xcb\x3f\xd0")
    payload[at + 1 : at + 9] = b"\x7f\xf8" + bytes(6)
    with pytest.raises(MessageError):
        decode(Manual, bytes(payload))


def test_following_begins_again_only_when_it_is_handed_back() -> None:
    robot = Robot()
    robot.take()
    robot.hold(0.5)
    robot.stand(30.0)
    assert robot.follower.state.driven_by == "hand"
    assert "by hand" in robot.follower.state.reason
    robot.follower.hand_back(robot.now_s)
    robot.step()
    assert robot.follower.state.driven_by == ""


def test_nobody_takes_the_robot_from_a_hand_that_holds() -> None:
    robot = Robot()
    robot.take()
    robot.hold(0.2)
    with pytest.raises(ManualError, match="hand drives by hand now"):
        robot.follower.take_by_hand(OTHER, "another", robot.now_s)
    with pytest.raises(ManualError, match="wait until they let go"):
        robot.follower.hand_back(robot.now_s)
    with pytest.raises(TargetError, match="by hand"):
        robot.follower.choose(TargetRequest(mode="nearest"))
    robot.stand(0.4)
    robot.follower.choose(TargetRequest(mode="nearest"))
    robot.step()
    assert robot.follower.state.driven_by == "", "to choose a person is to hand back"


def test_to_choose_nobody_hands_nothing_back() -> None:
    robot = Robot(target="nearest")
    robot.take()
    robot.follower.choose(TargetRequest(mode="none"))
    robot.step()
    assert robot.follower.state.driven_by == "hand"


def test_the_emergency_stop_wins_and_a_hand_that_held_on_has_to_let_go() -> None:
    robot = Robot()
    robot.take()
    assert robot.hold(0.5)[-1] > 0.1
    robot.follower.set_estop(True)
    assert robot.hold(1.0) == [0.0] * 50
    assert robot.follower.state.reason == "emergency stop"
    robot.follower.set_estop(False)
    assert robot.hold(1.0) == [0.0] * 50, "it still holds, since before the stop"
    robot.follower.observe_wish(wish(robot.seq, held=False), robot.now_s, robot.now_s)
    robot.seq += 1
    assert robot.hold(0.5)[-1] > 0.1


def test_speeds_are_those_of_driving_by_hand_and_never_above_the_limits() -> None:
    slow = Robot(max_linear_mps=0.3, max_angular_radps=0.4)
    slow.take()
    slow.hold(2.0, 1.0, -1.0)
    assert slow.follower.state.linear_mps == pytest.approx(0.3)
    assert slow.follower.state.angular_radps == pytest.approx(-0.4)
    usual = Robot()
    usual.take()
    usual.hold(2.0, 1.0, 1.0)
    assert usual.follower.state.linear_mps == pytest.approx(0.5)
    assert usual.follower.state.angular_radps == pytest.approx(0.8)
    told = usual.hold(2.0, -1.0)
    assert told[-1] == pytest.approx(0.0, abs=1e-4), "backward is forbidden by max_reverse_mps"
    assert "max_reverse_mps" in usual.follower.state.speed_reason
    back = Robot(max_reverse_mps=0.2)
    back.take()
    assert back.hold(2.0, -1.0)[-1] == pytest.approx(-0.2)


def test_the_robot_brakes_before_an_obstacle_and_stands_when_ranges_fail() -> None:
    robot = Robot()
    robot.take()
    way_m, speeds = 1.5, []
    for _ in range(150):
        sectors = tuple(
            RangeSector(bearing_rad=0.1 * n, width_rad=0.1, distance_m=way_m)
            for n in range(-31, 32)
        )
        robot.follower.observe_ranges(Ranges(seq=0, sectors=sectors), robot.now_s)
        speeds += robot.hold(STEP_S)
        way_m -= speeds[-1] * STEP_S
    assert max(speeds) > 0.3
    assert speeds[-1] == pytest.approx(0.0, abs=0.02)
    assert way_m > 0.25 + 0.1, "the robot's radius, and most of the margin"
    assert robot.hold(1.0)[-1] == 0.0, "ranges are stale"
    assert "ranges are older" in robot.follower.state.reason


def test_a_follower_that_starts_again_does_not_go_on_following() -> None:
    robot = Robot()
    robot.take()
    assert robot.follower.kept is None


def test_a_taken_robot_can_be_forbidden() -> None:
    robot = Robot(manual_linear_mps=0.0, manual_angular_radps=0.0)
    with pytest.raises(ManualError, match="manual_linear_mps"):
        robot.take()


def test_the_same_source_may_take_it_again_while_it_holds() -> None:
    drive = ManualDrive()
    drive.take(GRANT, "page", 0.0)
    assert drive.wish(wish(0), 0.0, 0.0) == ""
    drive.take(OTHER, "page", 0.1)
    assert drive.wished(0.1) is None
    assert drive.wish(wish(1), 0.1, 0.1), "of the grant before"


def test_a_stop_message_is_no_wish() -> None:
    with pytest.raises(MessageError):
        decode(Manual, encode(EStop(engaged=True, source="x")))
