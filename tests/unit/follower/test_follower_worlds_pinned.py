"""What the follower as a whole does in small worlds, pinned to the last digits.

Every world is rich in one kind of trouble: people that cross, hide, bend, a wall that comes near, a
picture that freezes. A constant anywhere in the follower that matters there moves these numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import count
from typing import Any

import pytest

from heel.schemas import Odometry, TargetRequest
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerSettings
from tests.support.pinned import Pinned, Rows, sums
from tests.unit.follower.people import TRACKER, person, tracks
from tests.unit.follower.posed_world import Body, Eye, Moment, PosedWorld, change, still
from tests.unit.follower.test_follower_motion import circle, straight, zigzag
from tests.unit.follower.test_moving_picture import FilmedWorld
from tests.unit.follower.walking_world import Sample, World


def crosses(t_s: float) -> tuple[float, float]:
    """In front of the robot from right to left and back."""
    return 2.2 + 0.8 * t_s, 2.5 * math.sin(0.7 * t_s)


def beside(t_s: float) -> tuple[float, float]:
    """Comes towards the robot, a step beside its way."""
    return 9.0 - 0.7 * t_s, 0.4


def walks_to_and_fro(t_s: float) -> tuple[float, float]:
    """Two metres there and two back, in six seconds."""
    return 3.5 + 1.0 * math.sin(math.pi * t_s / 3.0), 0.5 * math.cos(0.9 * t_s)


def jumps_in(t_s: float) -> tuple[float, float]:
    """Behind the robot until it stands before it at once."""
    return (1.3, 0.1) if 4.0 < t_s < 6.0 else (-3.0, 0.0)


def hidden_now_and_then(number: int, t_s: float) -> bool:
    return number == 1 and (3.0 < t_s < 3.4 or 5.0 < t_s < 6.5 or 8.0 < t_s < 13.0)


def film(samples: Sequence[Sample]) -> Rows:
    """Every second as it was, and the sums of everything."""
    rows: dict[str, Sequence[float | str]] = {
        f"{sample.t_s:.2f} s": (
            sample.command.state, sample.command.linear_mps, sample.command.angular_radps,
            sample.distance_m, sample.bearing_rad, sample.nearest_m,
        )
        for sample in samples[::50]
    }  # fmt: skip
    rows["sums"] = sums(
        (s.command.linear_mps, s.command.angular_radps, s.distance_m, s.bearing_rad)
        for s in samples
    )
    return rows


WALKING: dict[str, Callable[[], World]] = {
    "straight": lambda: _world({1: straight(1.4, to_s=6.0)}),
    "circle": lambda: _world({1: circle}, odometry=True),
    "zigzag-late": lambda: _world({1: zigzag}, command_s=0.45, inertia_s=0.3),
    "crossed": lambda: _world({1: straight(1.0), 2: crosses, 3: beside}),
    "to-and-fro": lambda: _world({1: walks_to_and_fro, 2: beside}, odometry=True),
    "jumped": lambda: _world({1: straight(1.2), 2: jumps_in}),
    "hidden": lambda: _world({1: zigzag}, hidden=hidden_now_and_then),
    "swings": lambda: _world({1: walks_to_and_fro}, command_s=0.6, inertia_s=0.2),
    "near": lambda: _world({1: straight(0.3, start_m=0.9, from_s=3.0)}, noise_px=2.0),
}


def _world(walks: dict[int, Any], **changes: Any) -> World:
    return World(walks, Follower(FollowerSettings()), **changes)


@pytest.mark.parametrize("name", WALKING)
def test_who_walks(name: str, pinned: Pinned) -> None:
    pinned(film(WALKING[name]().run(14.0)))


@pytest.mark.parametrize("told", [True, False], ids=["told", "not-told"])
@pytest.mark.parametrize("walk", [straight(1.4), circle], ids=["straight", "circle"])
def test_a_picture_that_freezes(walk: Any, told: bool, pinned: Pinned) -> None:
    world = FilmedWorld({1: walk}, Follower(FollowerSettings()), odometry=True, told=told,
                        freezes_s=4.0, noise_px=0.3)  # fmt: skip
    pinned(film(world.run(9.0)))


def posed(moments: Sequence[Moment]) -> Rows:
    rows: dict[str, Sequence[float | str | None]] = {
        f"{moment.t_s:.2f} s": (
            moment.state, moment.linear_mps, moment.distance_m, moment.told_m, moment.driven_to_m
        )
        for moment in moments[::50]
    }  # fmt: skip
    rows["sums"] = sums((m.linear_mps, m.distance_m, m.told_m or 0.0) for m in moments)
    return rows


def comes_and_goes(t_s: float) -> tuple[float, float]:
    return 3.0 + 1.2 * math.sin(0.5 * t_s), 0.6 * math.sin(0.8 * t_s)


def passes(t_s: float) -> tuple[float, float]:
    return 2.0, 4.0 - 0.8 * t_s


POSED: dict[str, Callable[[], PosedWorld]] = {
    "unknown-camera": lambda: PosedWorld({1: Body(comes_and_goes)}, Eye(flicker=0.2)),
    "unknown-camera-and-ranges": lambda: PosedWorld(
        {1: Body(comes_and_goes), 2: Body(passes)}, Eye(flicker=0.1), ranges=True
    ),
    "bends": lambda: PosedWorld({1: Body(still(3.0), change(0.0, 0.9, 4.0, 1.0, 8.0))}),
    "bends-before-ranges": lambda: PosedWorld(
        {1: Body(still(3.0), change(0.0, 0.9, 4.0, 1.0, 8.0))}, ranges=True
    ),
    "child": lambda: PosedWorld({1: Body(still(4.0), lambda _t: (0.0, 1.0), lambda _t: 0.3)}),
    "child-before-ranges": lambda: PosedWorld(
        {1: Body(comes_and_goes, lambda _t: (0.0, 1.2), lambda _t: 0.35)}, ranges=True,
        odometry=False,
    ),
    "behind-a-table": lambda: PosedWorld(
        {1: Body(comes_and_goes, change(0.75, 1.7, 3.0, 0.5))}, Eye(calibrated=True, pitch_deg=-8.0)
    ),
    "unstated-pitch": lambda: PosedWorld(
        {1: Body(comes_and_goes), 2: Body(passes)}, Eye(pitch_deg=8.0, height_m=1.2)
    ),
    "hidden-before-ranges": lambda: PosedWorld(
        {1: Body(comes_and_goes), 2: Body(passes)}, ranges=True,
        hidden=lambda number, t_s: number == 1 and 4.0 < t_s < 5.5,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", POSED)
def test_who_changes_posture(name: str, pinned: Pinned) -> None:
    pinned(posed(POSED[name]().run(12.0)))


def test_steps_that_come_late(pinned: Pinned) -> None:
    """After a pause the controller does as if it had been short, and the motion as if told."""
    follower = Follower(FollowerSettings())
    rows: dict[str, Sequence[float | str]] = {}
    t_s, gaps = 0.0, (0.05, 0.1, 0.15, 0.22, 0.3, 0.35, 0.45, 0.05, 0.8, 0.05, 1.2, 0.05)
    for seq, gap_s in zip(count(), gaps * 4):
        t_s += gap_s
        follower.observe(tracks(person(1, 320.0 + 40.0 * math.sin(seq), 120.0), seq=seq), TRACKER)
        if seq == 0:
            follower.step(t_s, 0.05)
            follower.choose(TargetRequest(mode="id", track_id=1))
        if seq > 24 and seq % 3 == 0:
            follower.observe_odometry(
                Odometry(seq=seq, x_m=0.0, y_m=0.0, heading_rad=0.0, linear_mps=0.4,
                         angular_radps=0.2), t_s - 0.02,
            )  # fmt: skip
        command = follower.step(t_s, 0.05)
        state = follower.state
        rows[f"{seq}"] = (command.state, command.linear_mps, command.angular_radps,
                          state.distance_m or 0.0, state.bearing_rad or 0.0)  # fmt: skip
    pinned(rows)
