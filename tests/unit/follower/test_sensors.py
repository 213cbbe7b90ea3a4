"""A sensor that cannot be read is not an absent sensor."""

from __future__ import annotations

import math

import pytest

from heel.schemas import CameraInfo, Odometry, Ranges, RangeSector, TargetRequest
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerSettings
from tests.unit.follower.people import TRACKER, person, tracks

_FAR = person(1, height=60.0)


class Driving:
    """A follower that follows, stepped at 50 Hz with fresh tracks."""

    def __init__(self) -> None:
        self.follower = Follower(FollowerSettings())
        self.now_s, self.seq = 0.0, 0
        self.follower.observe(tracks(_FAR), TRACKER)
        self.follower.choose(TargetRequest(mode="id", track_id=1))
        self.go(2.0)

    def go(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.02)):
            self.now_s += 0.02
            self.seq += 1
            self.follower.observe(tracks(_FAR, seq=self.seq), TRACKER)
            self.follower.step(self.now_s, 0.05)

    @property
    def told(self) -> tuple[str, str]:
        return self.follower.state.state, self.follower.state.reason

    @property
    def drives(self) -> bool:
        return self.follower.state.linear_mps > 0.3

    def ranges(self, *distances_m: float, seq: int = 0) -> None:
        width = 2 * math.pi / max(1, len(distances_m))
        sectors = tuple(
            RangeSector(
                bearing_rad=math.remainder(width * at, 2 * math.pi), width_rad=width, distance_m=far
            )
            for at, far in enumerate(distances_m)
        )  # fmt: skip
        self.follower.observe_ranges(Ranges(seq=seq, sectors=sectors), self.now_s)


@pytest.fixture
def driving() -> Driving:
    made = Driving()
    assert made.drives
    return made


@pytest.mark.parametrize("sensor", ["ranges", "odometry"])
def test_a_sensor_that_was_never_good_stops_the_robot_from_the_first_message_on(
    sensor: str, driving: Driving
) -> None:
    driving.follower.refuse(sensor, "sectors.1: too many", driving.now_s)  # type: ignore[arg-type]
    driving.go(0.02)
    assert driving.told == ("stopped", f"{sensor} cannot be read: sectors.1: too many")
    assert driving.follower.state.linear_mps == 0.0
    driving.go(2.0)
    assert driving.drives, "one odd message and then silence is no sensor"


def test_one_odd_message_beside_good_ones_stops_nobody(driving: Driving) -> None:
    for _ in range(20):
        driving.ranges(*[8.0] * 36)
        driving.follower.refuse("ranges", "odd", driving.now_s)
        driving.go(0.02)
        assert driving.drives


def test_junk_of_nobody_known_stops_nobody(driving: Driving) -> None:
    """Somebody who floods a sensor's topic must not be able to hold the robot up that way."""
    kinds = ["stamp: not msgpack", "ranges: 900 bytes", "stamp: seq: Field required"]
    for number in range(100):
        driving.follower.refuse("ranges", kinds[number % 3], driving.now_s, known=False)
        driving.go(0.02)
        assert driving.drives


def test_a_sensor_without_a_stamp_is_one_if_it_fails_alike_every_time(driving: Driving) -> None:
    for number in range(8):
        reason = f"ranges: {80_000 + number} bytes exceed the cap of 65536"
        driving.follower.refuse("ranges", reason, driving.now_s, known=False)
        driving.go(0.1)
    assert driving.told == (
        "stopped", "ranges cannot be read: ranges: 80007 bytes exceed the cap of 65536"
    )  # fmt: skip


def test_good_ranges_that_turn_unreadable_say_why_and_not_that_they_are_old(
    driving: Driving,
) -> None:
    driving.ranges(*[8.0] * 36)
    for _ in range(20):
        driving.go(0.02)
        driving.follower.refuse("ranges", "sectors: too many", driving.now_s)
    assert driving.told == ("stopped", "ranges cannot be read: sectors: too many")
    driving.ranges(*[8.0] * 36)
    driving.go(0.02)
    assert driving.told[0] != "stopped"


@pytest.mark.parametrize(
    ("distances_m", "words"),
    [
        ([], "no sectors: the sensor sees nothing"),
        ([math.nan] * 36, "every sector is nan"),
        ([8000.0 / 16] * 36, "is it in metres?"),
    ],
)
def test_ranges_that_say_nothing_stop_the_robot(
    distances_m: list[float], words: str, driving: Driving
) -> None:
    driving.ranges(*distances_m)
    driving.go(0.02)
    assert driving.told[0] == "stopped"
    assert words in driving.told[1]


def test_infinity_is_nothing_there_and_a_wall_is_seen_beside_it(driving: Driving) -> None:
    driving.ranges(*[math.inf] * 36)
    driving.go(0.02)
    assert driving.drives
    assert driving.follower.state.obstacle_watch
    driving.ranges(0.5, *[math.inf] * 35)
    driving.go(0.1)
    assert driving.follower.state.free_distance_m == pytest.approx(0.1)
    assert driving.follower.state.linear_mps < 0.3


@pytest.mark.parametrize("ahead_m", [-math.inf, math.nan, 0.0])
def test_too_near_and_not_measured_are_not_free(ahead_m: float, driving: Driving) -> None:
    driving.ranges(ahead_m, *[8.0] * 35)
    driving.go(0.1)
    assert driving.follower.state.free_distance_m == 0.0
    assert driving.follower.state.linear_mps == 0.0


def test_a_beam_that_fails_between_two_that_see_is_no_blind_spot(driving: Driving) -> None:
    driving.ranges(math.nan, *[8.0] * 359)
    driving.go(0.1)
    assert driving.drives
    driving.ranges(math.nan, 0.6, *[8.0] * 358)
    driving.go(0.02)
    assert driving.follower.state.free_distance_m == pytest.approx(0.2, abs=0.01)


@pytest.mark.parametrize("change", [{"linear_mps": 500.0}, {"angular_radps": -57.0}])
def test_odometry_in_other_units_stops_the_robot_and_is_said(
    change: dict[str, float], driving: Driving
) -> None:
    still = {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0, "linear_mps": 0.5, "angular_radps": 0.0}
    odd = Odometry.model_validate({"seq": 0} | still | change)
    driving.follower.observe_odometry(odd, driving.now_s)
    driving.go(0.02)
    assert driving.told[0] == "stopped"
    assert "per second?" in driving.told[1]


def test_a_camera_like_none_stops_the_robot_unless_a_true_one_is_known(driving: Driving) -> None:
    def camera(fov_rad: float) -> CameraInfo:
        return CameraInfo(
            stream="front", epoch=1, width=640, height=480, source_width=640, source_height=480,
            fps=20.0, source="a test", horizontal_fov_rad=fov_rad,
        )  # fmt: skip

    driving.follower.set_camera(camera(3.1415927410125732))
    driving.go(0.02)
    assert driving.told[0] == "stopped"
    assert "field of view of 180 degrees" in driving.told[1]
    driving.follower.set_camera(camera(1.0))
    driving.follower.set_camera(camera(5e-324))
    driving.go(2.0)
    assert driving.drives
