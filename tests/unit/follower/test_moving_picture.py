"""A picture that stands still while the robot moves is seen to be frozen, and only that one."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from heel.schemas import CameraMotion, TargetRequest, Tracks
from heel.services.follower.core import Follower
from heel.services.follower.own_motion import Pose
from heel.services.follower.settings import FollowerSettings
from tests.unit.follower.people import TRACKER, person, tracks
from tests.unit.follower.test_follower_motion import circle, straight, zigzag
from tests.unit.follower.walking_world import Sample, Walk, World

FROZEN = "the picture does not move though the robot does: is the camera frozen?"
IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
FREEZES_S = 8.0
FOCAL_PX = 320.0


@dataclass
class FilmedWorld(World):
    """Tells how the camera moves, and its picture freezes at a time, noise and all.

    Attributes:
        told: whether the tracks tell the camera's motion.
        freezes_s: from when on the picture stays as it is.
        grain_px: how far the edges of boxes in the frozen picture still jump.
    """

    told: bool = True
    freezes_s: float = math.inf
    grain_px: float = 0.0
    before: Pose = field(default_factory=Pose)
    kept: Tracks | None = None

    def _picture(self, t: float, random: np.random.Generator) -> Tracks:
        now = super()._picture(t, random)
        if t >= self.freezes_s:
            assert self.kept is not None
            jumping = [
                track.model_copy(update={"box_xyxy": tuple(
                    (np.array(track.box_xyxy) + random.uniform(-1, 1, 4) * self.grain_px).tolist()
                )})
                for track in self.kept.tracks
            ]  # fmt: skip
            affine = IDENTITY
            now = now.model_copy(update={"tracks": tuple(jumping)})
        else:
            self.kept = now
            turned = self.pose.heading_rad - self.before.heading_rad
            ahead_m = math.hypot(self.pose.x_m - self.before.x_m, self.pose.y_m - self.before.y_m)
            zoom = 1.0 + ahead_m / 15.0
            pan_px = 320 * (1 - zoom) + FOCAL_PX * math.tan(turned)
            affine = (zoom, 0.0, pan_px, 0.0, zoom, 240 * (1 - zoom))
        self.before = self.pose
        motion = CameraMotion(affine=affine, quality=0.95) if self.told else None
        return now.model_copy(update={"camera_motion": motion})


def run(walk: Walk, seconds: float = 14.0, **world: Any) -> list[Sample]:
    made = FilmedWorld({1: walk}, Follower(FollowerSettings()), odometry=True, **world)
    return made.run(seconds)


def reasons(samples: list[Sample]) -> set[str]:
    return {sample.command.reason for sample in samples}


@pytest.mark.parametrize("grain_px", [0.0, 2.0])
@pytest.mark.parametrize(
    "walk", [straight(1.0), straight(1.4), circle], ids=["1.0", "1.4", "circle"]
)
def test_a_frozen_picture_stops_the_robot_within_about_a_second(
    walk: Walk, grain_px: float
) -> None:
    samples = run(walk, freezes_s=FREEZES_S, grain_px=grain_px)
    after = [sample for sample in samples if sample.t_s > FREEZES_S]
    moves = [s.t_s for s in after if (s.command.linear_mps, s.command.angular_radps) != (0.0, 0.0)]
    assert max(moves) < FREEZES_S + 1.3
    assert after[-1].command.state == "stopped"
    assert after[-1].command.reason == FROZEN


@pytest.mark.parametrize("told", [True, False], ids=["told", "not told"])
@pytest.mark.parametrize("noise_px", [0.0, 1.0], ids=["exact", "noisy"])
@pytest.mark.parametrize(
    "walk", [straight(1.0), straight(1.6, to_s=9.0), circle, zigzag],
    ids=["straight", "stops", "circle", "zigzag"],
)  # fmt: skip
def test_somebody_who_walks_as_fast_as_the_robot_is_no_frozen_picture(
    walk: Walk, noise_px: float, told: bool
) -> None:
    assert FROZEN not in reasons(run(walk, 20.0, noise_px=noise_px, told=told))


def test_without_word_of_the_camera_a_box_that_ignores_the_robots_turning_is_frozen() -> None:
    def turns_aside(t_s: float) -> tuple[float, float]:
        return 4.0, -0.8 if t_s < 6 else 0.8

    assert FROZEN in reasons(run(turns_aside, 12.0, told=False, noise_px=0.0, freezes_s=6.1))


class Driven:
    """A follower before a still picture, which drives at it."""

    def __init__(self) -> None:
        self.follower = Follower(FollowerSettings())
        self.seq = 0
        self.see(0.1)
        self.follower.choose(TargetRequest(mode="id", track_id=1))

    def see(
        self, seconds: float, x: float = 320.0, shift_px: float = 0.0, agree: float = 0.95
    ) -> str:
        motion = CameraMotion(affine=(1.0, 0.0, shift_px, 0.0, 1.0, 0.0), quality=agree)
        for _ in range(round(seconds / 0.04)):
            self.seq += 1
            seen = tracks(person(1, x=x, height=60.0), seq=self.seq)
            self.follower.observe(seen.model_copy(update={"camera_motion": motion}), TRACKER)
            for half in (0.0, 0.02):
                self.follower.step(10.0 + self.seq * 0.04 + half, 0.02 + half)
        return self.follower.state.reason


def test_far_corners_that_stand_still_freeze_no_picture_whose_near_ones_move() -> None:
    assert Driven().see(4.0, agree=0.6) == "target in sight"


def test_the_robot_waits_until_the_picture_moves() -> None:
    driven = Driven()
    assert driven.see(4.0) == FROZEN
    assert driven.see(60.0) == FROZEN
    assert driven.see(1.0, x=330.0) == "target in sight"
    assert driven.follower.state.linear_mps > 0


def test_a_camera_that_moves_again_is_not_frozen() -> None:
    driven = Driven()
    assert driven.see(4.0) == FROZEN
    assert driven.see(0.6, shift_px=1.0) == "target in sight"


def test_who_is_chosen_anew_is_looked_at_anew() -> None:
    driven = Driven()
    driven.see(4.0)
    driven.follower.choose(TargetRequest(mode="none"))
    driven.follower.choose(TargetRequest(mode="id", track_id=1))
    assert driven.see(0.4) == "target in sight"
    assert driven.see(4.0) == FROZEN
