"""The person who stands before the robot for a while, and no other."""

from __future__ import annotations

import pytest

from heel.schemas import TargetRequest, Track
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerSettings
from tests.unit.follower.people import OTHER_TRACKER, TRACKER, person, tracks


def near(track_id: int = 1, bearing_rad: float = 0.0, distance_m: float = 1.5) -> Track:
    return person(track_id, bearing_rad=bearing_rad, distance_m=distance_m)


class Robot:
    """A follower that waits for somebody, and its clock."""

    def __init__(self) -> None:
        self.follower = Follower(FollowerSettings(imprint_s=2.0))
        self.follower.observe(tracks(), TRACKER)
        self.follower.choose(TargetRequest(mode="imprint"))
        self.now_s = 5.0

    def sees(
        self, *people: Track, seconds: float, tracker: str = TRACKER, age_s: float = 0.05
    ) -> int | None:
        """The same people for a while, at 20 Hz; who is chosen then."""
        for _ in range(round(seconds * 20)):
            self.now_s += 0.05
            self.follower.observe(tracks(*people), tracker)
            self.follower.step(self.now_s, age_s)
        return self.follower.target.track_id


def test_who_stands_before_the_robot_for_two_seconds_is_chosen() -> None:
    robot = Robot()
    assert robot.sees(near(3), seconds=1.9) is None
    assert robot.follower.state.state == "acquiring"
    assert "stand before the robot" in robot.follower.state.reason
    assert robot.sees(near(3), seconds=0.3) == 3
    assert robot.follower.target.mode == "imprint"
    robot.sees(near(3), seconds=0.5)
    assert robot.follower.state.state == "following"


@pytest.mark.parametrize(
    "people",
    [
        (near(bearing_rad=0.5),),
        (near(distance_m=3.0),),
        (near(1), near(2, bearing_rad=0.2)),
        (near().model_copy(update={"shown": False}),),
        (near().model_copy(update={"state": "occluded"}),),
        (),
    ],
    ids=["aside", "far", "two at once", "not shown", "occluded", "nobody"],
)
def test_who_does_not_stand_there_alone_and_seen_is_not_chosen(people: tuple[Track, ...]) -> None:
    assert Robot().sees(*people, seconds=5.0) is None


def test_others_farther_off_do_not_matter() -> None:
    assert Robot().sees(near(1), near(2, distance_m=4.0), seconds=2.5) == 1


def test_whoever_steps_away_begins_anew() -> None:
    robot = Robot()
    robot.sees(near(1), seconds=1.5)
    robot.sees(near(1, distance_m=3.0), seconds=0.2)
    assert robot.sees(near(1), seconds=1.5) is None
    assert robot.sees(near(1), seconds=0.7) == 1


def test_one_after_the_other_is_not_one_for_long() -> None:
    robot = Robot()
    robot.sees(near(1), seconds=1.5)
    assert robot.sees(near(2), seconds=1.5) is None


def test_stale_tracks_and_a_new_tracker_begin_anew() -> None:
    for change in ({"age_s": 1.0}, {"tracker": OTHER_TRACKER}):
        robot = Robot()
        robot.sees(near(1), seconds=1.5)
        robot.sees(near(1), seconds=0.1, **change)  # type: ignore[arg-type]
        assert robot.sees(near(1), seconds=1.0, tracker=change.get("tracker", TRACKER)) is None


def test_asking_anew_lets_go_of_the_old_person() -> None:
    robot = Robot()
    robot.sees(near(1), seconds=2.5)
    target = robot.follower.choose(TargetRequest(mode="imprint"))
    assert (target.mode, target.track_id) == ("imprint", None)
