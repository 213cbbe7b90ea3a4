"""What a witness writes down of a world: whom the robot followed, and where everybody was."""

from __future__ import annotations

import numpy as np
import pytest

from heel.schemas import FollowState, Target
from heel.services.loops.scenarios.witness import Moment, Witness
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.state import CameraMount
from heel.services.simulator.world import World

TARGET, OTHER, NOBODY = 0, 1, -1


@pytest.fixture
def world() -> World:
    return scenario("distractor-1", 0)


def state(name: str, track_id: int | None) -> FollowState:
    target = Target(seq=0, mode="none" if track_id is None else "id", track_id=track_id)
    return FollowState.model_validate(
        {"seq": 0, "state": name, "reason": "", "estop": False, "target": target,
         "linear_mps": 0.0, "angular_radps": 0.0}
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "track_id", "followed"),
    [
        ("following", 7, TARGET),
        ("following", 8, OTHER),
        ("occluded", 8, OTHER),
        ("following", 9, NOBODY),
        ("unsure", 8, NOBODY),
        ("searching", 8, NOBODY),
        ("stopped", 8, NOBODY),
        ("idle", None, NOBODY),
    ],
)
def test_only_acting_counts_as_following(
    world: World, name: str, track_id: int | None, followed: int
) -> None:
    witness = Witness(world)

    witness.record(
        Moment.of_world(world, [1.0] * len(world.people)),
        state(name, track_id),
        {7: TARGET, 8: OTHER},
    )

    assert witness.log().followed.tolist() == [followed]


def test_the_log_tells_which_track_is_on_each_person(world: World) -> None:
    witness = Witness(world)
    witness.record(Moment.of_world(world, [1.0, 1.0]), state("idle", None), {8: OTHER})

    assert witness.log().identities.tolist() == [[NOBODY, 8]]


def test_the_log_tells_what_the_world_was_like(world: World) -> None:
    witness = Witness(world)
    for _ in range(50):
        witness.record(Moment.of_world(world, [1.0] * len(world.people)), state("idle", None), {})
        world.step(0.02, 0.5, 0.0)
    log = witness.log()

    robot = world.robot
    assert log.period_s == pytest.approx(0.02)
    assert log.planned_s == world.scenario.duration_s
    assert np.hypot(*(log.robot_xy_m[-1] - log.robot_xy_m[0])) == pytest.approx(0.4, abs=0.1)
    assert log.linear_mps[-1] == pytest.approx(robot.linear_mps, abs=0.1)
    assert log.path_m[0] == pytest.approx(log.target_distance_m()[0], abs=0.01)
    assert log.path_from_start_m[0] == log.path_m[0]


def test_a_world_told_by_another_process_is_the_same_moment(world: World) -> None:
    for _ in range(50):
        world.step(0.02, 0.5, 0.1)
    told = world.truth(0, CameraMount())

    moment = Moment.of_truth(told)

    assert moment == Moment.of_world(world, [one.visible for one in told.people])
