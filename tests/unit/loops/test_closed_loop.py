"""The closed loop: deterministic, bounded, and with the delays of real processes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heel.evaluation.following.log import EpisodeLog
from heel.schemas import (
    DriveState,
    FrameId,
    MotionCommand,
    Pointed,
    Target,
    TargetRequest,
    Track,
    Tracks,
)
from heel.services.drive.core import Drive
from heel.services.drive.settings import DriveSettings
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerSettings
from heel.services.loops.control_loop import CONTROL_NS, TRACKS_AGE_NS
from heel.services.loops.scenarios.episode import load_stack, run_episode
from heel.services.loops.scenarios.loop import ClosedLoop
from heel.services.loops.scenarios.parallel import EpisodeTask
from heel.services.loops.scenarios.perception import Senses, SimulatedBoxes
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.state import CameraMount
from heel.services.simulator.world import World
from heel.services.tracker.settings import TrackerSettings

MOUNT = CameraMount()


class TrueSight:
    """Tracks of everybody who is to be seen, with the world's own ids: perfect perception."""

    def __init__(self, world: World) -> None:
        self._world = world

    def see(self, frame: FrameId) -> Tracks:
        truth = self._world.truth(frame.seq, MOUNT)
        return Tracks(
            **frame.model_dump(), width=MOUNT.width_px, height=MOUNT.height_px,
            source_width=MOUNT.width_px, source_height=MOUNT.height_px,
            tracks=tuple(
                Track(
                    id=person.id, state="tracked", box_xyxy=person.box_xyxy,
                    velocity_pxps=(0.0, 0.0), area_px=1.0, span_px=1.0, identity_confidence=1.0,
                    shown=True,
                )
                for person in truth.people
                if person.box_xyxy is not None and person.visible > 0.3
            ),
        )  # fmt: skip

    def point(self, pointed: Pointed) -> None:
        raise AssertionError(f"everybody is tracked: {pointed}")


class SightOnceAsked(TrueSight):
    """Shows nobody until a user has pointed at somebody."""

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self.points: list[Pointed] = []

    def see(self, frame: FrameId) -> Tracks:
        tracks = super().see(frame)
        return tracks if self.points else tracks.model_copy(update={"tracks": ()})

    def point(self, pointed: Pointed) -> None:
        self.points.append(pointed)


def beginning(name: str, seed: int, duration_s: float) -> World:
    """The first seconds of a scenario."""
    return World(replace(scenario(name, seed).scenario, duration_s=duration_s), seed)


def follow(world: World, perception: TrueSight | SimulatedBoxes) -> EpisodeLog:
    loop = ClosedLoop(
        world, MOUNT, perception, Follower(FollowerSettings()), Drive(DriveSettings())
    )
    return loop.run().log()


def test_equal_seeds_give_equal_episodes_and_others_differ() -> None:
    def last_place(seed: int) -> list[float]:
        world = beginning("distractor-1", seed, 3.0)
        log = follow(world, SimulatedBoxes(world, MOUNT, TrackerSettings()))
        return [*log.robot_xy_m[-1].tolist(), *log.linear_mps.tolist()]

    first = last_place(5)

    assert last_place(5) == first
    assert last_place(6) != first


def test_with_perfect_sight_somebody_who_walks_straight_on_is_kept_near() -> None:
    world = beginning("straight", 3, 16.0)
    log = follow(world, TrueSight(world))

    settled = log.t_s > 10.0
    assert not log.contact.any()
    assert log.t_s[-1] == pytest.approx(world.scenario.duration_s, abs=0.05)
    assert (log.followed[settled] == log.target).all()
    assert log.path_m[settled].max() < 3.0
    assert log.path_m[settled].min() > 1.0


class Watching(Follower):
    """A follower that notes how old the tracks are when it gets them."""

    def __init__(self) -> None:
        super().__init__(FollowerSettings())
        self.ages_s: list[float] = []
        self.chosen: list[TargetRequest] = []

    def step(self, now_s: float, tracks_age_s: float | None) -> MotionCommand:
        if tracks_age_s is not None:
            self.ages_s.append(tracks_age_s)
        return super().step(now_s, tracks_age_s)

    def choose(self, request: TargetRequest) -> Target:
        self.chosen.append(request)
        return super().choose(request)


def test_tracks_come_late_and_go_stale_while_the_camera_drops_out() -> None:
    world = beginning("drop-out", 0, 16.0)
    follower = Watching()
    ClosedLoop(world, MOUNT, TrueSight(world), follower, Drive(DriveSettings())).run()

    from_s, until_s = world.scenario.dropouts[0]
    newest_s = (TRACKS_AGE_NS - CONTROL_NS) / 1e9
    assert min(follower.ages_s) >= newest_s
    assert np.median(follower.ages_s) < 0.12
    assert max(follower.ages_s) >= until_s - from_s


def test_the_user_clicks_until_the_target_is_chosen_and_then_never_again() -> None:
    world = beginning("straight", 3, 4.0)
    follower = Watching()
    ClosedLoop(world, MOUNT, TrueSight(world), follower, Drive(DriveSettings())).run()

    assert [request.mode for request in follower.chosen] == ["point"]
    assert follower.target.track_id == world.target.id


class Reckless(Drive):
    """Wheels that go straight on at full speed whatever they are told."""

    def step(self, now_s: float) -> DriveState:
        return super().step(now_s).model_copy(update={"linear_mps": 1.6, "angular_radps": 0.0})


def test_contact_ends_the_episode() -> None:
    world = scenario("stands-still", 1)
    loop = ClosedLoop(
        world, MOUNT, TrueSight(world), Follower(FollowerSettings()), Reckless(DriveSettings())
    )
    log = loop.run().log()

    assert log.contact[-1]
    assert not log.contact[:-2].any()
    assert log.t_s[-1] < world.scenario.duration_s


def test_a_click_on_somebody_unseen_reaches_perception_and_the_next_one_chooses_them() -> None:
    world = beginning("straight", 3, 4.0)
    perception = SightOnceAsked(world)
    log = follow(world, perception)
    (pointed,) = perception.points
    assert pointed.frame.t_capture_ns * 1e-9 == pytest.approx(1.0, abs=0.15)
    assert log.state[-1] == "following"


@pytest.mark.parametrize("seed", [8004, pytest.param(9138, marks=pytest.mark.slow)])
def test_a_child_is_kept_from_by_a_robot_that_knows_neither_ranges_nor_its_camera(
    seed: int,
) -> None:
    stack = replace(load_stack("simulated boxes", None), senses=Senses(False, False))
    scores = run_episode(stack, EpisodeTask("child", seed)).scores
    assert scores.habitat.collision == 0.0
    assert scores.evt.success == 1.0
    assert scores.driven_to_m >= 0.6
