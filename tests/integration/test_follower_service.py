"""The follower's process: camera, ranges and odometry reach the core, and silence stops it."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
import zenoh

from schemas import (
    FollowState,
    Message,
    Odometry,
    Pointed,
    Ranges,
    Stamp,
    Target,
    TargetRequest,
    Track,
    Tracks,
    encode,
    keys,
)
from schemas.codec import decode
from schemas.robot import RangeSector
from tests.support import network
from tests.support.processes import running
from tests.unit.follower.people import TRACKER, person, tracks
from tests.unit.follower.walking_world import INFO

_PERIOD_S = 0.02


class Robot:
    """Plays tracker, camera and wheels for a follower's process, and hears its state."""

    def __init__(self, endpoint: str, resources: ExitStack) -> None:
        self.endpoint = endpoint
        self.session = resources.enter_context(network.client(endpoint))
        self._resources = resources
        self.states: list[FollowState] = []
        self.seq = 0
        self.people: tuple[Track, ...] = (person(1, height=60.0),)
        subscriber = self.session.declare_subscriber(keys.FOLLOW_STATE, self._note)
        resources.callback(subscriber.undeclare)
        self.start()

    def start(self) -> None:
        """Start the follower, or another after the one that has ended."""
        self.process = self._resources.enter_context(
            running("-m", "services.follower", "--connect", self.endpoint)
        )
        network.wait_until(lambda: "is up" in self.process.stderr(), "the follower", 30.0)

    def _note(self, sample: zenoh.Sample) -> None:
        self.states.append(
            decode(FollowState, sample.payload.to_bytes(), str(sample.encoding))
        )  # fmt: skip

    def put(self, key: str, message: Message, stamped: bool = True) -> None:
        stamp = Stamp(producer=TRACKER, t_sent_ns=time.time_ns(), age_ns=0)
        self.session.put(
            key, encode(message), encoding=message.encoding(),
            attachment=encode(stamp) if stamped else None,
        )  # fmt: skip

    def until(
        self, what: str, condition: Callable[[FollowState], bool], *beside: tuple[str, Message]
    ) -> FollowState:
        """Send good tracks, and more, until a state like that is told."""

        def told() -> bool:
            self.seq += 1
            self.put(keys.tracks("front"), self._picture())
            for key, message in beside:
                self.put(key, message.model_copy(update={"seq": self.seq}))
            time.sleep(_PERIOD_S)
            return bool(self.states) and condition(self.states[-1])

        network.wait_until(told, what)
        return self.states[-1]

    def _picture(self) -> Tracks:
        """A picture that stood still while the robot drives would be a frozen one."""
        shift_px = 5.0 * (self.seq % 4)
        people = []
        for one in self.people:
            left, top, right, bottom = one.box_xyxy
            box = (left + shift_px, top, right + shift_px, bottom)
            people.append(one.model_copy(update={"box_xyxy": box}))
        return tracks(*people, seq=self.seq)

    def choose(self, request: TargetRequest) -> Target:
        """Choose, on a machine so busy that the newest tracks may be too old for that once."""
        for _ in range(5):
            (reply,) = self.session.get(keys.FOLLOW_TARGET, payload=encode(request), timeout=5.0)
            if reply.ok is not None:
                break
            self.until("another picture", lambda _state: True)
        assert reply.ok is not None, reply.err
        return decode(Target, reply.ok.payload.to_bytes(), str(reply.ok.encoding))


@pytest.fixture
def robot() -> Iterator[Robot]:
    with ExitStack() as resources:
        endpoint = resources.enter_context(network.router())
        yield Robot(endpoint, resources)


def test_ranges_and_camera_reach_the_core_and_their_end_stops_the_robot(robot: Robot) -> None:
    robot.until("a first state", lambda state: state.state == "idle")
    robot.choose(TargetRequest(mode="id", track_id=1))
    plain = robot.until("driving", lambda state: state.linear_mps > 0.5)
    assert (plain.obstacle_watch, plain.free_distance_m) == (False, None)
    robot.put(keys.info("front"), INFO, stamped=False)
    wide = robot.until(
        "another distance", lambda state: abs((state.distance_m or 0) - (plain.distance_m or 0)) > 1
    )
    assert wide.distance_m is not None
    free = Ranges(
        seq=0, sectors=(RangeSector(bearing_rad=0.0, width_rad=1.0, distance_m=0.5),)
    )  # fmt: skip
    still = Odometry(seq=0, x_m=0.0, y_m=0.0, heading_rad=0.0, linear_mps=0.0, angular_radps=0.0)
    watched = robot.until(
        "an obstacle", lambda state: state.obstacle_watch and state.linear_mps < 0.4,
        (keys.ROBOT_RANGE, free), (keys.ROBOT_ODOMETRY, still),
    )  # fmt: skip
    assert watched.free_distance_m == pytest.approx(0.1)
    ended = robot.until("the end of ranges", lambda state: state.state == "stopped")
    assert ended.reason.startswith("ranges are older than")
    assert (ended.linear_mps, ended.angular_radps) == (0.0, 0.0)


def test_a_point_stays_pending_is_published_and_chosen_once_somebody_is_there(robot: Robot) -> None:
    robot.until("a first state", lambda state: state.state == "idle")
    with network.collected(robot.session, keys.FOLLOW_POINTED) as points:
        target = robot.choose(TargetRequest(mode="point", x_px=3.0, y_px=4.0))
        assert (target.mode, target.track_id) == ("point", None)
        sample = points.get(timeout=network.DEADLINE_S)
    pointed = decode(Pointed, sample.payload.to_bytes(), str(sample.encoding))
    assert (pointed.x_px, pointed.y_px, pointed.frame.stream) == (3.0, 4.0, "front")
    waiting = robot.until("pending", lambda state: state.pending_point_px is not None)
    assert waiting.reason == "looking for somebody there"
    robot.people = (person(1, height=60.0), person(2, box_xyxy=(-20.0, 0.0, 40.0, 200.0)))
    found = robot.until("somebody there", lambda state: state.target.track_id is not None)
    assert (found.target.mode, found.target.track_id) == ("point", 2)


def test_heel_follow_waits_for_what_becomes_of_a_point(robot: Robot) -> None:
    robot.until("a first state", lambda state: state.state == "idle")
    command = ("-m", "services", "follow", "3", "4", "--connect", robot.endpoint)
    with running(*command) as process:
        robot.until("pending", lambda state: state.pending_point_px is not None)
        robot.people = (person(2, box_xyxy=(-20.0, 0.0, 40.0, 200.0)),)
        robot.until("somebody there", lambda state: state.target.track_id is not None)
        assert process.wait(network.DEADLINE_S) == 0
        told = process.stdout()
    assert "looking for somebody there" in told
    assert "person 2 (point): found where you pointed" in told


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_follower_that_restarts_keeps_its_target(robot: Robot, number: signal.Signals) -> None:
    robot.until("a first state", lambda state: state.state == "idle")
    robot.choose(TargetRequest(mode="id", track_id=1))
    robot.until("driving", lambda state: state.linear_mps > 0.1)
    robot.process.stop(number, network.DEADLINE_S)
    robot.states.clear()
    robot.start()
    again = robot.until("driving again", lambda state: state.linear_mps > 0.1)
    assert (again.target.track_id, again.target.reason) == (
        1,
        "kept over a restart of the follower",
    )
    assert "acquiring" in {state.state for state in robot.states}
