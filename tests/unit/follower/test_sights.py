"""Two cameras on one robot: who is the same person, and when the other camera takes over."""

from __future__ import annotations

import math

import pytest

from heel.schemas import CameraInfo, Track, Tracks
from heel.services.follower.core import Follower
from heel.services.follower.own_motion import Pose
from heel.services.follower.settings import FollowerServiceSettings, FollowerSettings
from heel.services.follower.sights import HandOver, Sights
from tests.unit.follower.walking_world import INFO

FRAME_S = 0.04
YAW_RAD = math.radians(60.0)
FRONT = INFO.model_copy(update={"mount_yaw_rad": 0.0})
SIDE = INFO.model_copy(update={"stream": "side", "mount_yaw_rad": YAW_RAD})
SETTINGS = FollowerServiceSettings(cameras=("side",))
HALF_VIEW_RAD = math.radians(45.0)


def seen(track_id: int, distance_m: float, bearing_rad: float, info: CameraInfo) -> Track | None:
    """A person at a place before the robot, as a camera's tracker tells it; None out of view."""
    angle = bearing_rad - (info.mount_yaw_rad or 0.0)
    if abs(angle) > HALF_VIEW_RAD:
        return None
    x_px = info.width / 2 * (1.0 - math.tan(angle))
    box = (x_px - 30.0, 150.0, x_px + 30.0, 330.0)
    return Track(
        id=track_id, state="tracked", box_xyxy=box, velocity_pxps=(0.0, 0.0), area_px=10800.0,
        span_px=60.0, identity_confidence=0.99, missed_frames=0, shown=True,
        distance_m=distance_m, distance_sigma_m=0.15, bearing_rad=angle, bearing_sigma_rad=0.02,
    )  # fmt: skip


def frame(info: CameraInfo, number: int, *people: Track | None) -> Tracks:
    return Tracks(
        stream=info.stream, epoch=1, seq=number, index=number,
        t_capture_ns=round(number * FRAME_S * 1e9), width=info.width, height=info.height,
        source_width=info.width, source_height=info.height,
        tracks=tuple(one for one in people if one is not None),
    )  # fmt: skip


class Robot:
    """Plays both cameras to `Sights`, the front one being followed by."""

    def __init__(self, front: CameraInfo = FRONT, side: CameraInfo = SIDE) -> None:
        self.sights = Sights(SETTINGS, ("front", "side"))
        self.sights.set_camera("front", front)
        self.sights.set_camera("side", side)
        self.number = 0
        self.side_tracker = "tracker/side@00000002"

    def look(self, frames: int, *people: tuple[float, float], side_only: bool = False
             ) -> HandOver | None:  # fmt: skip
        """Let people stand at (distance, bearing): ids 1, 2 in front, 11, 12 at the side."""
        for _ in range(frames):
            self.number += 1
            t_s = self.number * FRAME_S
            self.sights.follow("front", 1)
            for name, info, first, tracker in (
                ("front", FRONT, 1, "tracker/front@00000001"),
                ("side", SIDE, 11, self.side_tracker),
            ):
                there = [] if side_only and name == "front" else [
                    seen(first + one, *place, info) for one, place in enumerate(people)
                ]  # fmt: skip
                message = frame(info, self.number, *there)
                self.sights.observe(name, message, tracker, t_s, Pose())
        return self.sights.better(self.number * FRAME_S)


OVERLAP, SIDE_ONLY = (3.0, math.radians(35.0)), (3.0, math.radians(70.0))


def test_a_person_seen_by_both_for_a_while_is_handed_over_on_leaving_the_picture() -> None:
    robot = Robot()
    assert robot.look(20, OVERLAP) is None, "seen well by the camera it is followed by"
    over = robot.look(3, SIDE_ONLY)
    assert over is not None
    assert (over.camera, over.track_id) == ("side", 11)
    robot.sights.handed_over(over)
    assert "also front 1" in robot.sights.words


@pytest.mark.parametrize("frames", [1, 8])
def test_a_glance_is_not_enough(frames: int) -> None:
    robot = Robot()
    robot.look(frames, OVERLAP)
    assert robot.look(3, SIDE_ONLY) is None


def test_two_people_near_each_other_are_nobody_in_particular() -> None:
    robot = Robot()
    robot.look(30, OVERLAP, (3.2, math.radians(38.0)))
    assert robot.look(3, SIDE_ONLY) is None


def test_two_people_apart_are_told_apart() -> None:
    robot = Robot()
    robot.look(30, OVERLAP, (7.0, math.radians(20.0)))
    over = robot.look(3, SIDE_ONLY, (7.0, math.radians(20.0)))
    assert over is not None
    assert over.track_id == 11


def test_a_person_that_only_the_other_camera_has_seen_is_never_guessed() -> None:
    robot = Robot()
    robot.look(20, (3.0, 0.0))
    assert robot.look(30, SIDE_ONLY) is None


@pytest.mark.parametrize(
    "lacking", ["mount_yaw_rad", "mount_height_m", "mount_pitch_rad", "horizontal_fov_rad"]
)
def test_without_calibration_nothing_is_handed_over_and_that_is_said(lacking: str) -> None:
    robot = Robot(side=SIDE.model_copy(update={lacking: None}))
    robot.look(30, OVERLAP)
    assert robot.look(3, SIDE_ONLY) is None
    assert "no hand-over without fov, height, pitch, yaw of side" in robot.sights.words


def test_ids_of_another_tracker_mean_other_people() -> None:
    robot = Robot()
    robot.look(20, OVERLAP)
    robot.side_tracker = "tracker/side@00000003"
    assert robot.look(3, SIDE_ONLY) is None


def test_what_the_ground_contradicts_is_taken_back() -> None:
    robot = Robot()
    robot.look(20, OVERLAP)
    # The side camera's track goes its own way: it was on somebody else.
    for _ in range(3):
        robot.number += 1
        t_s = robot.number * FRAME_S
        for name, info, track in (
            ("front", FRONT, seen(1, *OVERLAP, FRONT)),
            ("side", SIDE, seen(11, 6.0, math.radians(60.0), SIDE)),
        ):
            tracker = robot.side_tracker if name == "side" else "tracker/front@00000001"
            robot.sights.observe(name, frame(info, robot.number, track), tracker, t_s, Pose())
    assert robot.look(3, SIDE_ONLY) is None


def test_what_agreed_long_ago_does_not_count() -> None:
    robot = Robot()
    robot.look(20, OVERLAP)
    robot.number += round(6.0 / FRAME_S)
    assert robot.look(3, SIDE_ONLY) is None


def test_a_camera_that_died_is_followed_on_by_the_other() -> None:
    robot = Robot()
    robot.look(20, OVERLAP)
    robot.number += round(0.4 / FRAME_S)
    over = robot.look(1, OVERLAP, side_only=True)
    assert over is not None
    assert over.words == "handed over from front: out of sight here"


def test_the_follower_goes_on_driving_over_a_hand_over() -> None:
    follower = Follower(FollowerSettings(confirm_s=0.1))
    follower.set_camera(FRONT)
    now_s = 0.0
    for number in range(12):
        now_s = number * FRAME_S
        follower.observe(frame(FRONT, number, seen(1, *OVERLAP, FRONT)), "tracker/a@00000001")
        if number == 1:
            follower._choice._set("id", 1, "chosen")
        follower.step(now_s, 0.0)
    assert follower.state.state == "following"
    assert follower.decided
    follower.set_camera(SIDE)
    follower.hand_over(
        frame(SIDE, 12, seen(11, *OVERLAP, SIDE)), "tracker/b@00000002", 11, "handed over"
    )
    for number in range(13, 16):
        now_s = number * FRAME_S
        command = follower.step(now_s, 0.0)
        assert follower.state.state == "following"
        assert command.angular_radps > 0, "still to the left"
        follower.observe(frame(SIDE, number, seen(11, *OVERLAP, SIDE)), "tracker/b@00000002")
    assert follower.target.track_id == 11
    assert follower.state.bearing_rad == pytest.approx(OVERLAP[1], abs=0.15), "of the robot"


def test_one_camera_twice_and_lossless_runs_are_refused() -> None:
    with pytest.raises(ValueError, match="name one twice"):
        FollowerServiceSettings(cameras=("front",))
    with pytest.raises(ValueError, match="live only"):
        FollowerServiceSettings(cameras=("side",), delivery="lossless")
