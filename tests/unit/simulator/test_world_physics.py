"""How the robot moves, what stops it, and what the same seed gives."""

from __future__ import annotations

import math

import numpy as np
import pytest

from heel.schemas import encode
from heel.services.simulator.boxes import SimulatedDetector
from heel.services.simulator.errors import SimulatorError
from heel.services.simulator.robot import RobotBody, drive_arc
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.state import RobotState
from heel.services.simulator.walks import Leg, Walk
from heel.services.simulator.world import World
from tests.unit.simulator.empty_worlds import MOUNT, actor, box, frame, world

STEP_S = 0.02


def drive(it: World, seconds: float, linear_mps: float, angular_radps: float) -> list[RobotState]:
    states = []
    for _ in range(round(seconds / STEP_S)):
        it.step(STEP_S, linear_mps, angular_radps)
        states.append(it.robot)
    return states


def record(name: str, seed: int, seconds: float = 4.0) -> list[bytes]:
    it = scenario(name, seed)
    detector = SimulatedDetector(MOUNT, seed)
    messages = [encode(it.world_message())]
    for index in range(round(seconds / STEP_S)):
        it.step(STEP_S, 0.6, 0.2 * math.sin(index / 20))
        if index % 5 == 0:
            messages += [
                encode(message)
                for message in (
                    it.truth(index, MOUNT),
                    it.odometry(index),
                    it.ranges(index),
                    detector.detect(it, frame(index)),
                )
            ]
    return messages


@pytest.mark.parametrize("name", ["crowd", "distractor-2", "light-switch"])
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(name: str) -> None:
    first = record(name, 5)
    assert first == record(name, 5)
    assert first[0] != record(name, 6, 0.0)[0]
    assert first[1:] != record(name, 6)[1:]


def test_reading_sensors_more_often_does_not_change_how_the_world_moves_on() -> None:
    watched, unwatched = scenario("crowd", 1), scenario("crowd", 1)
    for index in range(100):
        watched.ranges(index)
        watched.step(STEP_S, 0.5, 0.1)
        unwatched.step(STEP_S, 0.5, 0.1)
    assert encode(watched.truth(0, MOUNT)) == encode(unwatched.truth(0, MOUNT))


@pytest.mark.parametrize(
    ("linear_mps", "angular_radps"), [(1.0, 0.0), (0.8, 0.5), (0.0, 1.0), (-0.4, -0.7)]
)
def test_constant_wheel_speeds_drive_the_arc_of_the_textbook(
    linear_mps: float, angular_radps: float
) -> None:
    state = RobotState(1.0, 2.0, 0.3, 0.0, 0.0)
    for _ in range(100):
        state = drive_arc(state, linear_mps, angular_radps, 0.02)
    heading = 0.3 + 2.0 * angular_radps
    if angular_radps:
        radius = linear_mps / angular_radps
        x_m = 1.0 + radius * (math.sin(heading) - math.sin(0.3))
        y_m = 2.0 - radius * (math.cos(heading) - math.cos(0.3))
    else:
        x_m, y_m = 1.0 + 2.0 * math.cos(0.3), 2.0 + 2.0 * math.sin(0.3)
    assert (state.x_m, state.y_m, state.heading_rad) == pytest.approx((x_m, y_m, heading))


def test_the_robot_begins_to_move_only_after_the_latency_of_its_commands() -> None:
    states = drive(world(), 0.2, 1.0, 1.0)
    moving = [state.linear_mps > 0 for state in states]
    # The command given at 0 arrives at 0.06 and shows at the end of that step.
    assert moving.index(True) == 3
    assert states[2].angular_radps == 0.0


def test_speed_and_acceleration_stay_within_what_the_body_can_do() -> None:
    body = RobotBody()
    it = world()
    states = drive(it, 2.0, 9.0, -9.0) + drive(it, 2.0, -9.0, 9.0)
    linear = np.array([0.0] + [state.linear_mps for state in states])
    angular = np.array([0.0] + [state.angular_radps for state in states])
    assert linear.max() == pytest.approx(body.max_linear_mps, rel=1e-3)
    assert angular.max() == pytest.approx(body.max_angular_radps, rel=1e-3)
    assert np.abs(np.diff(linear)).max() <= body.max_linear_mps2 * STEP_S + 1e-9
    assert np.abs(np.diff(angular)).max() <= body.max_angular_radps2 * STEP_S + 1e-9


def test_told_to_stop_the_robot_stops() -> None:
    it = world()
    drive(it, 2.0, 1.0, 0.5)
    stopped = drive(it, 1.5, 0.0, 0.0)[-1]
    assert abs(stopped.linear_mps) < 1e-3
    assert abs(stopped.angular_radps) < 1e-3


@pytest.mark.parametrize("heading_rad", [0.0, 0.6, -1.0])
def test_no_wall_lets_the_robot_through(heading_rad: float) -> None:
    wall = box(2.0, 0.0, 0.2, 30.0)
    it = world(obstacles=(wall,), robot=RobotState(0.0, 0.0, heading_rad, 0.0, 0.0))
    states = drive(it, 8.0, 1.6, 0.0)
    assert max(state.x_m for state in states) == pytest.approx(1.9 - 0.25, abs=1e-6)
    # What of its speed points along the wall it keeps.
    assert states[-1].linear_mps < 1.6 * math.sin(abs(heading_rad)) ** 2 + 0.1


def test_a_corner_holds_the_robot() -> None:
    walls = box(2.0, 0.0, 0.2, 30.0), box(0.0, 2.0, 30.0, 0.2)
    it = world(obstacles=walls, robot=RobotState(0.0, 0.0, 0.7, 0.0, 0.0))
    last = drive(it, 8.0, 1.0, 0.0)[-1]
    assert (last.x_m, last.y_m) == pytest.approx((1.65, 1.65), abs=1e-6)


def test_driving_into_somebody_counts_as_one_contact_and_does_not_run_them_over() -> None:
    it = world(actor(2.0, 0.0))
    last = drive(it, 6.0, 1.0, 0.0)[-1]
    assert it.contacts == 1
    assert it.truth(0, MOUNT).contact == 1
    assert math.hypot(last.x_m - it.target.x_m, last.y_m - it.target.y_m) >= 0.47 - 1e-6
    drive(it, 1.0, -0.5, 0.0)
    drive(it, 3.0, 1.0, 0.0)
    assert it.contacts == 2


def test_somebody_who_walks_up_to_a_standing_robot_does_not_touch_it() -> None:
    it = world(actor(3.0, 0.0, Walk(1.2, (Leg(-3.0, 0.0),)), heading_rad=math.pi))
    nearest = math.inf
    for _ in range(400):
        it.step(STEP_S, 0.0, 0.0)
        nearest = min(nearest, math.hypot(it.target.x_m, it.target.y_m))
    assert it.contacts == 0
    assert nearest >= 0.25 + 0.22 + 0.05 - 1e-6
    assert it.target.x_m < -2.5


def test_odometry_drifts_but_not_far() -> None:
    it = world(robot=RobotState(5.0, -3.0, 1.0, 0.0, 0.0))
    assert it.odometry(0).x_m == 0.0
    drive(it, 10.0, 1.0, 0.1)
    belief, robot = it.odometry(1), it.robot
    ahead, left = robot.x_m - 5.0, robot.y_m + 3.0
    x_m = math.cos(1.0) * ahead + math.sin(1.0) * left
    y_m = math.cos(1.0) * left - math.sin(1.0) * ahead
    error = math.hypot(belief.x_m - x_m, belief.y_m - y_m)
    assert 0.0 < error < 1.0


@pytest.mark.parametrize(
    ("dt_s", "linear_mps", "angular_radps"),
    [(0.02, math.nan, 0.0), (0.02, 0.0, math.inf), (0.0, 0.0, 0.0), (0.5, 0.0, 0.0)],
)
def test_what_is_no_step_is_refused_with_its_value(
    dt_s: float, linear_mps: float, angular_radps: float
) -> None:
    with pytest.raises(SimulatorError, match=r"nan|inf|0\.0|0\.5"):
        world().step(dt_s, linear_mps, angular_radps)


def test_an_unknown_scenario_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(SimulatorError, match=r"'strait'.*straight, turns"):
        scenario("strait", 0)
