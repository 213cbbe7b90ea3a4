"""What each part of the follower makes of made-up numbers, pinned to the last digits.

Grids step by less than a factor of two, so that a threshold that is halved or doubled lies on the
other side of some value.
"""

from __future__ import annotations

import itertools
import logging
import math
import os
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heel.schemas import (
    CameraInfo,
    CameraMotion,
    FrameId,
    HeelError,
    Odometry,
    Ranges,
    Taken,
    Target,
    TargetRequest,
)
from heel.schemas.robot import RangeSector
from heel.services.follower.box_scale import BoxScale
from heel.services.follower.camera_info import CameraInfos, implausible
from heel.services.follower.clearance import Body, Room, Sectors, room_before_person_m
from heel.services.follower.controller import Goal, VelocityController
from heel.services.follower.core import Follower
from heel.services.follower.estimate import PlaceFilter, polar_covariance
from heel.services.follower.frame_times import FrameTimes
from heel.services.follower.freshness import Freshness
from heel.services.follower.kept import KeptTarget, TargetFile
from heel.services.follower.learned_ground import LearnedGround
from heel.services.follower.learned_width import LearnedWidth
from heel.services.follower.limits import LimitedVelocity
from heel.services.follower.moving_picture import PictureWatch
from heel.services.follower.own_motion import OwnMotion, Pose
from heel.services.follower.pending import PendingPoint
from heel.services.follower.people import People, Person
from heel.services.follower.people_ranges import RangesInTime
from heel.services.follower.search import search_for
from heel.services.follower.sensors import Sensors, implausible_odometry, implausible_ranges
from heel.services.follower.settings import FollowerSettings
from heel.services.follower.surroundings import Surroundings
from heel.services.follower.swing import Swing
from heel.services.geometry.camera import Pinhole
from tests.support.pinned import Pinned, Value
from tests.unit.follower.people import TRACKER, person, tracks

Row = list[Value]


def scale(least: float, most: float, factor: float = 1.5) -> list[float]:
    """Values from one to another, each greater than the one before by a factor below two."""
    count = math.ceil(math.log(most / least) / math.log(factor)) + 1
    return [least * factor**step for step in range(count)]


def random(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


# --- What is learned, and filtered


@pytest.mark.parametrize("fall_m", [0.06, 0.5, 1.2])
def test_ground(fall_m: float, pinned: Pinned) -> None:
    """Upright people, some that bend, a pause of a minute and one of twenty seconds."""
    made, rng, rows, t_s = LearnedGround(), random(1), {}, 0.0
    for step in range(60):
        t_s += (0.0, 0.02, 0.05, 0.3, 0.7)[step % 5] + {30: 20.0, 45: 60.0}.get(step, 0.0)
        distance_m = float(rng.uniform(1.5, 6.0))
        off = {7: 0.5, 13: 0.2, 19: 0.12, 21: -0.13, 27: 0.08, 29: -0.1, 41: 0.16, 50: 0.3}.get(
            step, float(rng.normal(0, 0.03))
        )
        slope = fall_m / distance_m * (1.0 + off) + 0.08
        made.learn(slope, distance_m, float(rng.uniform(0.0, 0.02 + 0.06 * (step % 2))), t_s)
        line = made.line
        rows[f"{step}"] = [None] if line is None else [line.fall_m, line.offset]
    pinned(rows)


def test_width(pinned: Pinned) -> None:
    rows = {}
    for feet_seen in (True, False):
        made, rng, t_s = LearnedWidth(), random(2), 0.0
        for step in range(140):
            t_s += (0.03, 0.05, 0.1, 0.25)[step % 4]
            width_m = {30: 0.9, 31: 1.4, 32: 2.5}.get(step, float(rng.normal(0.5, 0.06)))
            made.learn(width_m, t_s, feet_seen or step % 3 == 0)
            if step < 12 or step % 6 == 0:
                rows[f"{feet_seen} {step}"] = [made.width_m]
    pinned(rows)


@pytest.mark.parametrize("share", [0.3, 0.55, 0.9, 1.0, 1.15, 1.2, 1.4, 2.0])
def test_box_scale(share: float, pinned: Pinned) -> None:
    made, rng, rows = BoxScale(), random(3), {}
    for step in range(60):
        t_s = 0.09 * step + (2.5 if step > 40 else 0.0)
        told_m = {50: 0.08, 51: 0.15}.get(step, float(rng.uniform(1.0, 3.0)))
        passing = step in range(20, 28) or step in range(33, 36)
        made.learn(told_m, 0.4 * told_m if passing else share * told_m, t_s)
        rows[f"{step}"] = [made.scale, made.measured(t_s), made.measured(t_s + 0.7),
                           made.measured(t_s + 1.4)]  # fmt: skip
    pinned(rows)


@pytest.mark.parametrize("speed_mps", [0.0, 1.0, 2.0, 4.0])
def test_place(speed_mps: float, pinned: Pinned) -> None:
    """A person that walks, jumps by 0.5 to 3 m, and is out of sight for up to three seconds."""
    rng, t_s, rows = random(4), 0.0, {}
    made = PlaceFilter(np.array([3.0, 0.5]), np.diag([0.04, 0.01]), 0.0)
    for step in range(60):
        gap_s = {20: 0.6, 30: 1.2, 40: 3.0}.get(step, 0.05)
        t_s += gap_s
        jump = {25: 0.5, 35: 1.0, 45: 1.5, 52: 3.0}.get(step, 0.0)
        true = np.array([3.0 + speed_mps * t_s + jump, 0.5 + 0.2 * math.sin(t_s)])
        covariance = polar_covariance(0.2, float(np.hypot(*true)), 0.15, 0.02)
        made.update(true + rng.normal(0, 0.1, 2), covariance, t_s)
        ahead = [made.place_at(t_s + later_s) for later_s in (0.0, 0.4, 0.9, 1.7)]
        rows[f"{step}"] = [*made.velocity, *itertools.chain(*ahead)]
    pinned(rows)


def test_covariance(pinned: Pinned) -> None:
    values = itertools.product((0.0, 0.7), (0.0, 2.0), (0.0, 0.3), (0.0, 0.05))
    pinned({f"{one}": [*map(float, polar_covariance(*one).ravel())] for one in values})


def test_limits(pinned: Pinned) -> None:
    rows = {}
    for wished in (0.001, 0.05, 0.4, 1.5, -0.6):
        made = LimitedVelocity(0.8, 1.5, 3.0)
        told = [made.towards(wished if step < 40 else 0.3, 0.02 + 0.03 * (step % 2))
                for step in range(70)]  # fmt: skip
        rows[f"{wished}"] = [*map(float, told)]
    pinned(rows)


def test_a_wish_that_differs_by_rounding_is_reached() -> None:
    """Speeds are told exactly where they are reached: a robot that stands is told zero."""
    for off, reached in ((0.6e-9, True), (1.6e-9, False)):
        made = LimitedVelocity(1.0, 1.0, 10.0)
        made.velocity = 0.5 + off
        assert (made.towards(0.5, 1e-4) == 0.5) is reached


def test_swing(pinned: Pinned) -> None:
    """Half periods of 0.25 to 4 s, even and uneven, and a long calm."""
    rows = {}
    for half_s, uneven in itertools.product(scale(0.25, 4.0, 1.4), (1.0, 1.5, 2.5)):
        made, t_s, shares = Swing(), 0.0, []
        for way in range(22):
            for side in np.sin(np.linspace(0.0, math.pi, 12)):
                t_s += half_s * (uneven if way % 2 else 1.0) / 12
                made.told(t_s, float((-1) ** way * side * (0.4 if way < 18 else 0.25)))
            shares.append(made.share)
        made.told(t_s + 30.0, 0.0)
        rows[f"{half_s:.3f} {uneven}"] = [*shares, made.share, made.swings]
    pinned(rows)


# --- Whether what comes can be used


@pytest.mark.parametrize("late_s", [0.05, 0.15, 0.18, 0.24])
def test_freshness(late_s: float, pinned: Pinned) -> None:
    """Frames at several rates with pauses: what is said, and for how long it stays so."""
    rows: dict[str, Row] = {}
    for interval_s in (0.04, 0.1, 0.15, 0.22, 0.4):
        made, next_s, newest_s, row = Freshness(0.25, 0.2), 0.0, -1.0, cast(Row, [])
        said: str | None = "?"
        for step in range(1200):
            now_s = 0.02 * step
            pause = 4.0 < now_s < 4.4 or 6.0 < now_s < 6.4 or 8.5 < now_s < 9.2 or now_s > 19.0
            if now_s >= next_s - 1e-9 and not pause:
                made.frame(now_s - late_s, late_s)
                newest_s, next_s = now_s - late_s, now_s + interval_s
            if (reason := made.judge(now_s, now_s - newest_s)) != said:
                row += [now_s, reason]
                said = reason
        rows[f"{interval_s}"] = row
    pinned(rows)


def test_trouble_that_comes_again(pinned: Pinned) -> None:
    """Staleness at several distances from the one before: how long it takes to be fresh again."""
    rows: dict[str, Row] = {}
    for apart_s in (1.5, 2.2, 3.0, 4.2, 5.5, 7.0, 9.0, 12.0):
        made = Freshness(0.25, 0.2)
        made.judge(10.0, 0.5)
        for step in range(round(apart_s / 0.02)):
            made.judge(10.02 + 0.02 * step, 0.1)
        made.judge(10.0 + apart_s, 0.5)
        waits = [made.judge(10.0 + apart_s + 0.05 * step, 0.1) is None for step in range(1, 30)]
        rows[f"{apart_s}"] = [waits.index(True)]
    pinned(rows)


def test_late_or_rare(pinned: Pinned) -> None:
    """Whether frames that leave so little time are said to come late or too seldom."""
    rows: dict[str, Row] = {}
    for spare_s in (0.008, 0.012, 0.02, 0.03, 0.04, 0.06, 0.09):
        made = Freshness(0.25, 0.2)
        for frame in range(10):
            made.frame(0.1 * frame, 0.25 - spare_s)
        rows[f"{spare_s}"] = [made.judge(1.0, 0.26)]
    pinned(rows)


def test_how_many_frames_tell_a_rate(pinned: Pinned) -> None:
    rows: dict[str, Row] = {}
    for frames, silent in itertools.product((1, 2, 3, 5, 7, 12, 13, 24, 30), (1.5, 2.5, 4.0, 7.0)):
        made = Freshness(0.25, 0.2)
        for frame in range(frames):
            interval_s = 0.3 if frame < frames - 8 else 0.22
            made.frame(interval_s * frame, 0.1)
        rows[f"{frames} {silent}"] = [made.judge(10.0, 0.1 + 0.22 * silent)]
    pinned(rows)


def info(**changes: Any) -> CameraInfo:
    values = {
        "stream": "front", "epoch": 1, "width": 640, "height": 480, "source_width": 640,
        "source_height": 480, "fps": 20.0, "source": "a test", "horizontal_fov_rad": 1.2,
    }  # fmt: skip
    return CameraInfo.model_validate(values | changes)


def test_what_no_camera_is_like(pinned: Pinned) -> None:
    fields = {
        "horizontal_fov_rad": [*scale(0.01, 1.0), 2.0, 2.9, 3.0, 3.1],
        "mount_height_m": scale(0.004, 100.0),
        "mount_pitch_rad": [*scale(0.2, 0.75), 1.2, 1.45, 1.5, 1.55],
    }
    rows: dict[str, Row] = {}
    for field, values in fields.items():
        for value in values:
            try:
                rows[f"{field} {value:.4f}"] = [implausible(info(**{field: value}))]
            except ValueError:
                rows[f"{field} {value:.4f}"] = ["refused by the message"]
    pinned(rows)


def test_descriptions_that_are_the_same_and_how_many_are_kept(pinned: Pinned) -> None:
    rows: dict[str, Row] = {}
    for field, value in {"horizontal_fov_rad": 1.2, "mount_height_m": 0.8}.items():
        for off in scale(0.0003, 0.003, 1.4):
            infos = CameraInfos("front")
            infos.hear(info(mount_height_m=0.8))
            rows[f"{field} {off:.5f}"] = [
                infos.hear(info(**{"mount_height_m": 0.8, field: value + off}))
            ]
    infos = CameraInfos("front")
    for epoch in range(1, 21):
        infos.hear(info(epoch=epoch))
    rows["kept"] = [infos.of(epoch) is not None for epoch in range(1, 21)]
    pinned(rows)


def test_what_no_sensor_says(pinned: Pinned) -> None:
    rows: dict[str, Row] = {}
    for value in scale(2.0, 60.0, 1.4):
        odometry = Odometry(seq=0, x_m=0.0, y_m=0.0, heading_rad=0.0, linear_mps=value,
                            angular_radps=0.0)  # fmt: skip
        turning = odometry.model_copy(update={"linear_mps": 0.0, "angular_radps": value})
        rows[f"{value:.3f}"] = [implausible_odometry(odometry), implausible_odometry(turning)]
    for value in scale(20.0, 400.0, 1.4):
        rows[f"nearest {value:.1f}"] = [implausible_ranges(lidar({}, value))]
    pinned(rows)


def lidar(seen: dict[int, float], farthest_m: float = 6.0, degrees: int = 10) -> Ranges:
    """Sectors all around; what some of them see, by bearing in degrees."""
    return Ranges(
        seq=0,
        sectors=tuple(
            RangeSector(bearing_rad=math.remainder(math.radians(at), 2 * math.pi),
                        width_rad=math.radians(degrees), distance_m=seen.get(at, farthest_m))
            for at in range(0, 360, degrees)
        ),
    )  # fmt: skip


def test_sensors_that_speak_and_cannot_be_read(pinned: Pinned) -> None:
    """Refused once and for a while, known and unknown, with good messages between; when it ends."""
    rows: dict[str, Row] = {}
    for sensor, known, lasts_s, good in itertools.product(
        ("ranges", "odometry", "camera"), (True, False), (0.0, 0.25, 0.5, 0.9), (True, False)
    ):
        sensors, row, said = Sensors(FollowerSettings()), cast(Row, []), ""
        for step in range(140):
            now_s = 0.05 * step
            if good and step % 3 == 0 and now_s < 1.0:
                sensors.good(cast(Any, sensor), now_s)
            if 0.5 <= now_s <= 0.5 + lasts_s:
                sensors.refused(cast(Any, sensor), f"value {step} is odd", now_s, known)
            if (trouble := sensors.trouble(now_s)) != said:
                said = trouble
                row += [now_s, trouble]
        rows[f"{sensor} {known} {lasts_s} {good}"] = row
    pinned(rows)


def test_when_frames_were_taken(pinned: Pinned) -> None:
    times = FrameTimes("mine")
    for seq in range(3000):
        times.hear(_taken(seq), 10.0 + 0.02 * seq)
    rows: dict[str, Row] = {
        f"frame {seq}": [*times.taken_s(_frame(seq), 80.0)] for seq in range(0, 3000, 97)
    }
    last_s = 10.0 + 0.02 * 2999
    rows["heard"] = [times.heard(last_s + gap_s) for gap_s in scale(0.5, 6.0, 1.4)]
    pinned(rows)


def _taken(seq: int) -> Taken:
    return Taken(**_frame(seq).model_dump(), clock="0a", monotonic_ns=1)


def _frame(seq: int) -> FrameId:
    return FrameId(stream="front", epoch=1, seq=seq, index=seq, t_capture_ns=seq * 20_000_000)


# --- The picture that stands still


@pytest.mark.parametrize("told", [True, False], ids=["told", "not-told"])
@pytest.mark.parametrize("grain_px", [0.0, 3.0, 5.0])
@pytest.mark.parametrize("height_px", [40.0, 200.0, 440.0])
def test_when_a_still_picture_is_frozen(
    told: bool, grain_px: float, height_px: float, pinned: Pinned
) -> None:
    """The robot drives or turns, evenly or not; each row: when it was known, and what then."""
    rows: dict[str, Row] = {}
    drives = [*((v, 0.0) for v in scale(0.1, 1.2, 1.8)), *((0.0, w) for w in scale(0.03, 0.6, 1.8))]
    for (linear_mps, turn_radps), uneven in itertools.product(drives, (False, True)):
        watch, pose, rng = PictureWatch(), Pose(), random(5)
        row: Row = []
        for step in range(40):
            t_s = 0.1 * step
            share = math.sin(2.0 * t_s) if uneven else 1.0
            pose = pose.moved(share * linear_mps, share * turn_radps, 0.1)
            edges = np.array([320 - height_px / 5, 440 - height_px, 320 + height_px / 5, 440])
            if grain_px:
                edges = edges + np.clip(rng.normal(0, grain_px / 2, 4), -grain_px, grain_px) / 2
            still = person(1).model_copy(update={"box_xyxy": tuple(map(float, edges))})
            affine = (1.0, 0.0, 0.02 * (step % 2), 0.0, 1.0, 0.0)
            motion = CameraMotion(affine=affine, quality=0.93 if told else 0.0)
            frame = tracks(still, seq=step).model_copy(update={"camera_motion": motion})
            watch.frame(frame, t_s, still, 3.0, pose)
            if watch.frozen != (len(row) % 2 == 1):
                row.append(t_s)
        rows[f"{linear_mps:.3f} {turn_radps:.3f} {uneven}"] = row
    pinned(rows)


def test_what_shows_that_the_camera_moves(pinned: Pinned) -> None:
    """A shift or a share of agreeing corners, from frame to frame, while the robot drives."""
    rows: dict[str, Row] = {}
    for shift_px, quality in itertools.product((0.0, *scale(0.01, 4.0)), (0.3, 0.6, 0.8, 0.9, 1.0)):
        watch, pose, row = PictureWatch(), Pose(), cast(Row, [])
        for step in range(120):
            pose = pose.moved(0.5, 0.0, 0.05)
            motion = CameraMotion(
                affine=(1.0, 0.0, shift_px if step > 50 else 0.0, 0.0, 1.0, 0.0),
                quality=quality if step > 50 else 1.0,
            )
            frame = tracks(person(1), seq=step).model_copy(update={"camera_motion": motion})
            watch.frame(frame, 0.05 * step, person(1), 3.0, pose)
            if watch.frozen != (len(row) % 2 == 1):
                row.append(0.05 * step)
        rows[f"{shift_px:.3f} {quality}"] = row
    pinned(rows)


# --- Own motion, ranges, and the room that they leave


def test_own_motion(pinned: Pinned) -> None:
    """Commands and odometry, with pauses of up to a second; where it was up to 3 s ago."""
    motion, rows, t_s = OwnMotion(0.2, 0.3), cast(dict[str, Row], {}), 0.0
    for step in range(80):
        t_s += {20: 0.3, 30: 0.6, 40: 1.1}.get(step, 0.05)
        motion.advance(t_s)
        motion.told(t_s, 0.8, 0.5 * math.sin(t_s))
        if step > 50 and step % 4 == 0:
            motion.odometry(Odometry(seq=step, x_m=0.0, y_m=0.0, heading_rad=0.0, linear_mps=0.3,
                                     angular_radps=-0.2), t_s)  # fmt: skip
        poses = [motion.pose_at(t_s - back_s) for back_s in (0.0, 0.13, 0.9, 1.6, 2.4, 3.3)]
        poses.append(motion.pose_soon())
        if step % 2 == 0:
            rows[f"{step}"] = [value for p in poses for value in (p.x_m, p.y_m, p.heading_rad)]
    pinned(rows)


def test_ranges_to_people(pinned: Pinned) -> None:
    motion = OwnMotion(0.1, 0.3)
    for step in range(60):
        motion.odometry(Odometry(seq=step, x_m=0.0, y_m=0.0, heading_rad=0.0, linear_mps=0.5,
                                 angular_radps=0.3), 0.05 * step)  # fmt: skip
        motion.advance(0.05 * step)
    rows: dict[str, Row] = {}
    for off_m, degrees, gap_s in itertools.product(
        (-0.6, -0.3, -0.15, 0.0, 0.1, 0.25, 0.5, 0.8), (5, 10, 18, 30), (-0.4, -0.15, 0.0, 0.1, 0.3)
    ):
        pose = motion.pose_at(2.5)
        place = PlaceFilter(np.array(pose.place(2.0, 0.1)), np.diag([0.09, 0.05]), 2.4)
        place.update(np.array(pose.place(2.05, 0.12)), np.diag([0.09, 0.05]), 2.5)
        ranges = RangesInTime(Sectors(lidar({}, 2.0 - off_m, degrees)), 2.5 + gap_s)
        told_m = ranges.sharpen(place, 2.5, motion)
        rows[f"{off_m} {degrees} {gap_s}"] = [told_m, *place.place_at(2.5), *place.velocity]
    pinned(rows)


def test_free_ways(pinned: Pinned) -> None:
    """Random rooms with blind beams, walls beside and gaps."""
    rng, rows = random(6), cast(dict[str, Row], {})
    for number, degrees in itertools.product(range(6), (1, 4, 5, 8, 10, 12)):
        wall = {at: float(rng.choice([0.3, 0.6, 1.0, 2.0, 3.0, math.inf]))
                for at in range(0, 360, degrees)}  # fmt: skip
        for at in range(0, 360, degrees):
            if rng.random() < 0.25:
                wall[at] = math.nan
        sectors = Sectors(lidar(wall, degrees=degrees))
        row: Row = []
        for direction_rad in (0.0, 0.3, -0.6, 1.5, math.pi):
            row += [
                sectors.free_m(Body(0.25, 0.15), direction_rad),
                sectors.towards_m(direction_rad),
                sectors.towards_m(direction_rad, 0.12),
            ]
        rows[f"{number} {degrees}"] = row
    pinned(rows)


def test_walls_beside(pinned: Pinned) -> None:
    """A wall at one bearing: from where on it is beside, and its margin counts no more."""
    rows: dict[str, Row] = {}
    for degrees, distance_m in itertools.product(range(0, 100, 5), (0.3, 0.35, 0.4, 0.5)):
        seen = Ranges(seq=0, sectors=(
            RangeSector(bearing_rad=0.0, width_rad=0.02, distance_m=5.0),
            RangeSector(bearing_rad=math.radians(degrees), width_rad=0.02, distance_m=distance_m),
        ))  # fmt: skip
        rows[f"{degrees} {distance_m}"] = [Sectors(seen).free_m(Body(0.25, 0.15))]
    pinned(rows)


def test_room_before_people(pinned: Pinned) -> None:
    rows: dict[str, Row] = {}
    for ahead_m, left_m in itertools.product((0.2, 0.6, 1.2, 2.5, 5.0), (0.0, 0.3, 0.8, 1.5)):
        row: Row = []
        for vx_mps, vy_mps in itertools.product((-1.5, -0.6, 0.0, 1.0), (-1.4, -0.5, 0.0, 0.8)):
            row.append(room_before_person_m((ahead_m, left_m), (vx_mps, vy_mps), 1.2))
        rows[f"{ahead_m} {left_m}"] = row
    pinned(rows)


@cache
def _settled(place: tuple[float, float], velocity: tuple[float, float]) -> PlaceFilter:
    made = PlaceFilter(np.array(place) - np.array(velocity), np.eye(2) * 1e-4, 0.0)
    for step in range(1, 11):
        at = np.array(place) - np.array(velocity) * (1.0 - 0.1 * step)
        made.update(at, np.eye(2) * 1e-4, 0.1 * step)
    return made


def somebody(
    number: int, place: tuple[float, float], velocity: tuple[float, float] = (0.0, 0.0),
    **changes: Any,
) -> Person:  # fmt: skip
    """A person whose filter has settled on a place and a velocity at the time 1."""
    made = _settled(place, velocity)
    values: dict[str, Any] = {
        "id": number, "distance_m": math.hypot(*place), "bearing_rad": math.atan2(*place[::-1]),
        "seen_s": 1.0, "place": place, "filter": made, "box_scale": BoxScale(),
        "width": LearnedWidth(), "certain": True, "by_height": False, "reserve_m": 0.0,
        "least_share": 1.0,
    }  # fmt: skip
    return Person(**(values | changes))


def among(*people: Person) -> People:
    return cast(People, SimpleNamespace(known={one.id: one for one in people}))


@pytest.mark.parametrize("seen", [True, False])
@pytest.mark.parametrize("least_share", [1.0, 0.53])
def test_room(seen: bool, least_share: float, pinned: Pinned) -> None:
    """The followed one at several distances, another beside, walls near and far."""
    rows: dict[str, Row] = {}
    for ahead_m, wall_m, turn_radps in itertools.product(
        (0.9, 1.3, 2.0, 3.2, 4.5), (None, 0.7, 1.1, 1.6, 2.4), (0.0, 0.9, -1.5)
    ):
        surroundings = Surroundings(FollowerSettings())
        if wall_m is not None:
            wall = dict.fromkeys((*range(0, 25, 5), *range(345, 360, 5)), wall_m)
            surroundings.observe(Sectors(lidar(wall, 4.0, 5)), 1.0)
        by_height = least_share < 1.0
        followed = somebody(1, (ahead_m, 0.1), (0.4, 0.0), by_height=by_height,
                            least_share=least_share, reserve_m=0.25 * by_height)  # fmt: skip
        row: Row = []
        for left_m in (0.3, 1.1, 1.7):
            other = somebody(2, (2.0, left_m), (-0.3, -0.2), certain=left_m > 1.0)
            for people in (among(followed), among(followed, other)):
                room = surroundings.room(people, 1, Pose(), 1.05, 0.5, turn_radps, seen)
                row += [room.ahead_m, room.behind_m, room.ahead_ends_at]
        rows[f"{ahead_m} {wall_m} {turn_radps}"] = row
    pinned(rows)


def test_room_where_the_robot_turns_to(pinned: Pinned) -> None:
    """A post at one bearing, and a robot that turns towards it at several rates."""
    rows: dict[str, Row] = {}
    for degrees, turn_radps in itertools.product((15, 25, 35, 50, 70), (-1.0, 0.3, 0.6, 1.0, 1.6)):
        surroundings = Surroundings(FollowerSettings())
        surroundings.observe(Sectors(lidar({degrees: 1.2}, 6.0, 5)), 1.0)
        people = among(somebody(1, (4.0, 0.0)))
        room = surroundings.room(people, 1, Pose(), 1.0, 0.5, turn_radps, True)
        rows[f"{degrees} {turn_radps}"] = [room.ahead_m, room.ahead_ends_at]
    pinned(rows)


def test_sidesteps(pinned: Pinned) -> None:
    surroundings, rows = Surroundings(FollowerSettings()), cast(dict[str, Row], {})
    for ahead_m, left_m, vx_mps in itertools.product(
        (0.3, 0.5, 0.7, 1.0, 1.8, 3.0, 4.4, 6.0, 9.0, 11.0), (-0.9, -0.2, 0.1, 0.6, 1.2, 1.5, 1.7),
        (-0.8, 0.0, 0.3, 0.45),
    ):  # fmt: skip
        people = among(somebody(1, (3.0, 0.0)), somebody(2, (ahead_m, left_m), (vx_mps, 0.05)))
        rows[f"{ahead_m} {left_m} {vx_mps}"] = [
            surroundings.sidestep_rad(people, 1, Pose(), 1.0, speed_mps)
            for speed_mps in (0.0, 0.35, 0.7, 1.2)
        ]
    pinned(rows)


# --- What is driven


@pytest.mark.parametrize("room_m", [0.1, 0.5, math.inf])
def test_velocities(room_m: float, pinned: Pinned) -> None:
    """Goals near and far, to either side, that come, stand and go; speed, turning, reason."""
    rows: dict[str, Row] = {}
    for ahead_m, left_m, vx_mps, vy_mps in itertools.product(
        (0.2, 0.45, 0.8, 1.35, 1.48, 1.58, 1.7, 2.5), (0.0, 0.05, 0.5),
        (-0.6, 0.0, 0.1, 0.2, 0.27, 1.0), (0.0, 0.3),
    ):  # fmt: skip
        controller = VelocityController(FollowerSettings())
        goal, room = Goal((ahead_m, left_m), (vx_mps, vy_mps)), Room(room_m, math.inf, "a wall")
        for _ in range(10):
            told = controller.follow(goal, room, 0.0, 0.05)
        rows[f"{ahead_m} {left_m} {vx_mps} {vy_mps}"] = [*told, controller.speed_reason]
    pinned(rows)


def test_braking(pinned: Pinned) -> None:
    """At full speed, with less and less room: when it brakes, and when it stops dead."""
    controller, rows = VelocityController(FollowerSettings()), cast(dict[str, Row], {})
    goal = Goal((6.0, 0.0), (1.0, 0.0))
    for step in range(120):
        room = Room(3.0 if step < 40 else max(0.0, 3.0 - 0.045 * (step - 40)), math.inf, "a wall")
        linear, angular = controller.follow(goal, room, 0.05 if step > 60 else 0.0, 0.05)
        rows[f"{step}"] = [linear, angular, controller.speed_reason]
    pinned(rows)


def test_turning_to(pinned: Pinned) -> None:
    controller = VelocityController(FollowerSettings())
    pinned({f"{at:.4f}": [controller.turn_to(at, 0.6)] for at in scale(0.01, 1.0)})


def test_search(pinned: Pinned) -> None:
    """Turned towards each heading in steps, until it counts as reached."""
    rows: dict[str, Row] = {}
    for step_rad in (0.02, 0.05, 0.09, 0.12):
        search = search_for(Pose(), (2.0, 0.5), (2.0, -0.5), 1.0, 0.6)
        pose, row = Pose(), cast(Row, [])
        for _ in range(200):
            off_rad = search.bearing_rad(pose)
            row.append(off_rad)
            if search.over:
                break
            pose = pose.moved(0.0, math.copysign(step_rad, off_rad), 1.0)
        rows[f"{step_rad}"] = row
    pinned(rows)


def test_how_far_to_either_side_is_looked(pinned: Pinned) -> None:
    """A person out of sight: the headings of the robot while it looks round, which obeys."""
    follower, heading_rad, rows = Follower(FollowerSettings()), 0.0, cast(dict[str, Row], {})
    for step in range(400):
        t_s = 0.05 * step
        seen = () if t_s > 2.0 else (person(1, 320.0, 160.0),)
        follower.observe(tracks(*seen, seq=step), TRACKER)
        if step == 2:
            follower.choose(TargetRequest(mode="id", track_id=1))
        follower.observe_odometry(
            Odometry(seq=step, x_m=0.0, y_m=0.0, heading_rad=0.0, linear_mps=0.0,
                     angular_radps=follower.state.angular_radps), t_s,
        )  # fmt: skip
        command = follower.step(t_s, 0.05)
        heading_rad += 0.05 * command.angular_radps
        if step % 10 == 0:
            rows[f"{step}"] = [command.state, heading_rad, command.angular_radps]
    pinned(rows)


# --- Who is meant


def test_how_old_a_picture_may_be_to_choose_in(pinned: Pinned) -> None:
    rows: dict[str, Row] = {}
    for age_s in scale(0.1, 2.0, 1.3):
        follower = Follower(FollowerSettings())
        follower.observe(tracks(person(1)), TRACKER)
        follower.step(1.0, 0.05)
        follower.step(1.0 - 0.05 + age_s, age_s)
        try:
            rows[f"{age_s:.3f}"] = [follower.choose(TargetRequest(mode="id", track_id=1)).reason]
        except HeelError as error:
            rows[f"{age_s:.3f}"] = [str(error).partition(" are ")[0]]
    pinned(rows)


def test_who_stands_before_the_robot(pinned: Pinned) -> None:
    rows: dict[str, Row] = {}
    for distance_m, bearing_rad in itertools.product(scale(0.8, 6.0, 1.3), (0.0, *scale(0.1, 0.9))):
        follower = Follower(FollowerSettings(target="imprint", imprint_s=0.5))
        told = person(1).model_copy(update={"distance_m": distance_m, "bearing_rad": bearing_rad})
        for step in range(20):
            follower.observe(tracks(told, seq=step), TRACKER)
            follower.step(0.05 * step, 0.05)
        rows[f"{distance_m:.3f} {bearing_rad:.3f}"] = [follower.target.track_id]
    pinned(rows)


def test_one_box_for_two(pinned: Pinned) -> None:
    """Boxes of two people that cover each other by more and more; what a click on one says."""
    rows: dict[str, Row] = {}
    for apart_px in range(0, 90, 6):
        follower = Follower(FollowerSettings())
        follower.observe(tracks(person(1, 320.0), person(2, 320.0 + apart_px)), TRACKER)
        follower.step(1.0, 0.05)
        rows[f"{apart_px}"] = [follower.choose(TargetRequest(mode="id", track_id=1)).reason]
    pinned(rows)


def test_points_without_a_person(pinned: Pinned) -> None:
    """How far off and how much later a person may appear, and where turning carries the point."""
    rows: dict[str, Row] = {}
    for off_px, later_s in itertools.product((30.0, 50.0, 70.0, 90.0, 130.0, 180.0, 260.0),
                                             (0.0, 0.1, 0.2, 0.4, 0.7, 1.5)):  # fmt: skip
        point = PendingPoint(320.0, 300.0, tracks(seq=1), 1.0)
        found = point.found(tracks(person(5, 320.0 + off_px), seq=2), 1.0 + later_s)
        rows[f"{off_px} {later_s}"] = [None if found is None else found.id]
    point = PendingPoint(100.0, 300.0, tracks(seq=1), 1.0)
    for step in range(2, 40):
        point.carry(tracks(seq=2 * step), 0.1 if step < 20 else -0.25, 500.0)
        rows[f"carried {step}"] = [*point.place_px, point.for_s(0.3 * step)]
    pinned(rows)


def test_the_note_of_whom_it_followed(tmp_path: Path, pinned: Pinned) -> None:
    """How old it may be, how long it may be, and when it is renewed."""
    note, log = tmp_path / "target.json", logging.getLogger("test")
    target = Target(seq=1, mode="id", track_id=3, reason="chosen", tracker=TRACKER)
    kept = KeptTarget(target=target, scene=("front", 1, 640, 480))
    rows: dict[str, Row] = {}
    for age_s in (-3.0, -1.5, -0.7, 0.0, 3.0, 7.0, 14.0, 22.0):
        TargetFile(note, log).save(kept)
        os.utime(note, (time.time() - age_s,) * 2)
        rows[f"{age_s}"] = [TargetFile(note, log).load() is not None]
    for size in (1000, 3000, 5000, 9000):
        text = kept.model_dump_json()
        note.write_text(text[:-1] + " " * (size - len(text)) + text[-1])
        rows[f"{size} bytes"] = [TargetFile(note, log).load() is not None]
    file, renewed = TargetFile(note, log), cast(Row, [])
    file.save(kept)
    for step in range(40):
        os.utime(note, (1.0, 1.0))
        file.renew(100.0 + 0.15 * step)
        renewed.append(note.stat().st_mtime > 1.0)
    rows["renewed"] = renewed
    pinned(rows)


# --- People in the picture


def boxed(
    camera: Pinhole, ahead_m: float, left_m: float, tall_m: float, eye_m: float = 0.8
) -> tuple[float, float, float, float]:
    mounted = camera.mounted(eye_m, 0.0)
    low, high = (mounted.pixels([ahead_m, left_m, z]) for z in (0.0, tall_m))
    half = camera.focal_px * 0.25 / ahead_m
    column = float(low[0])
    return (max(0.0, column - half), max(0.0, float(high[1])), min(640.0, column + half),
            min(480.0, float(low[1])))  # fmt: skip


@pytest.mark.parametrize("mounted", [True, False], ids=["mounted", "unmounted"])
def test_people_in_the_picture(mounted: bool, pinned: Pinned) -> None:
    """One walks off, jumps and bends, one is told by the tracker, some are pixels wide."""
    camera = Pinhole.from_fov(640, 480, 1.2)
    people, motion, rows = People(1.7, 1.2), OwnMotion(0.1, 0.3), cast(dict[str, Row], {})
    people.set_camera(info(mount_height_m=0.8, mount_pitch_rad=0.0) if mounted else info())
    for step in range(70):
        t_s = 0.05 * step
        motion.advance(t_s)
        ahead_m = 2.5 + {20: 0.5, 21: 1.2, 22: -0.8}.get(step, 0.0) + 0.4 * math.sin(t_s)
        # Not exactly as high as is assumed: rounding, which processors differ in, would decide.
        tall_m = 1.72 if step < 35 else max(0.92, 1.72 - 0.1 * (step - 35))
        walker = person(1).model_copy(update={"box_xyxy": boxed(camera, ahead_m, 0.3, tall_m)})
        leaver = person(2).model_copy(
            update={"box_xyxy": boxed(camera, 2.0 + 0.4 * (step // 4), -0.6, 1.6)}
        )
        told = person(3).model_copy(
            update={"distance_m": (3.0, 80.0, 130.0, 250.0)[step // 8 % 4],
                    "bearing_rad": 0.1 + 0.02 * (step % 2),
                    "distance_sigma_m": 0.2 if step < 6 else None,
                    "bearing_sigma_rad": 0.05 if step < 6 else None}
        )  # fmt: skip
        thin = [
            person(10 + at, 100.0 + 40 * at).model_copy(
                update={"box_xyxy": (100.0 + 40 * at, 200.0, 100.0 + 40 * at + wide, 230.0)}
            )
            for at, wide in enumerate((0.4, 0.7, 1.5, 2.5))
        ]
        seen = [walker, leaver, told, *thin]
        if step in range(40, 48) or step in range(55, 70):
            seen = [walker]
        people.update(tracks(*seen, seq=step), t_s, motion, 1)
        if step % 6 == 0:
            people.observe(Sectors(lidar({}, 2.2 + 0.2 * math.sin(t_s), 5)), t_s)
        row: Row = []
        for number in sorted(people.known):
            one = people.known[number]
            row += [number, *one.filter.place_at(t_s), *one.velocity(Pose(), t_s), one.distance_m,
                    one.bearing_rad, one.certain, one.reserve_m, one.least_share,
                    one.box_scale.scale]  # fmt: skip
        if step % 2 == 1:
            rows[f"{step}"] = row
    pinned(rows)


@pytest.mark.parametrize(
    ("gaps_s", "steps_m"),
    [
        ((0.05, 0.05), (0.5, 1.5)), ((0.3, 0.3), (0.5, 1.5)), ((0.5, 0.9), (1.0, 1.0)),
        ((0.7, 0.4), (-0.3, 3.0)),
    ],
)  # fmt: skip
def test_people_that_leave(
    gaps_s: Sequence[float], steps_m: Sequence[float], pinned: Pinned
) -> None:
    """As fast as people can walk, and no faster, whether it is certain where they stand or not."""
    camera, rows = Pinhole.from_fov(640, 480, 1.2), cast(dict[str, Row], {})
    for tall_m, mounted, from_m in itertools.product((1.7, 1.2), (True, False), (1.5, 3.0)):
        people, motion = People(1.7, 1.2), OwnMotion(0.1, 0.3)
        people.set_camera(info(mount_height_m=0.8, mount_pitch_rad=0.0) if mounted else info())
        t_s, ahead_m, row = 0.0, from_m, cast(Row, [])
        for number, (gap_s, step_m) in enumerate(
            [(0.05, 0.0)] * 12 + list(zip(gaps_s, steps_m, strict=True)) + [(0.05, -0.6)] * 3
        ):
            t_s, ahead_m = t_s + gap_s, ahead_m + step_m
            motion.advance(t_s)
            one = person(1).model_copy(update={"box_xyxy": boxed(camera, ahead_m, 0.0, tall_m)})
            people.update(tracks(one, seq=number), t_s, motion, None)
            if 1 in people.known:
                row += [people.known[1].distance_m, *people.known[1].filter.place_at(t_s)]
        rows[f"{tall_m} {mounted} {from_m}"] = row
    pinned(rows)
