"""The follower's process: camera, ranges and odometry reach the core, and silence stops it."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
import zenoh

from heel.schemas import (
    FollowState,
    Health,
    Message,
    Odometry,
    Pointed,
    Ranges,
    Stamp,
    Taken,
    Target,
    TargetRequest,
    Track,
    Tracks,
    encode,
    keys,
)
from heel.schemas.codec import decode
from heel.schemas.robot import RangeSector
from heel.services.runtime.clock import monotonic_clock
from tests.support import network
from tests.support.processes import running
from tests.unit.follower.people import TRACKER, person, tracks
from tests.unit.follower.test_sights import FRONT, OVERLAP, SIDE, frame, seen
from tests.unit.follower.walking_world import INFO

_PERIOD_S = 0.02
SIDE_TRACKER = "tracker/side@00000002"


class Robot:
    """Plays tracker, camera and wheels for a follower's process, and hears its state."""

    def __init__(self, endpoint: str, resources: ExitStack, *flags: str) -> None:
        self.endpoint = endpoint
        self.session = resources.enter_context(network.client(endpoint))
        self._resources = resources
        self.flags = flags
        self.states: list[FollowState] = []
        self.health: Health | None = None
        self.seq = 0
        self.people: tuple[Track, ...] = (person(1, height=60.0),)
        subscriber = self.session.declare_subscriber(keys.FOLLOW_STATE, self._note)
        resources.callback(subscriber.undeclare)
        health = self.session.declare_subscriber(keys.health("follower", "main"), self._hear)
        resources.callback(health.undeclare)
        self.start()

    def start(self) -> None:
        """Start the follower, or another after the one that has ended."""
        self.process = self._resources.enter_context(
            running("-m", "heel.services.follower", "--connect", self.endpoint, *self.flags)
        )
        network.wait_until(lambda: "is up" in self.process.stderr(), "the follower", 30.0)

    def _note(self, sample: zenoh.Sample) -> None:
        self.states.append(
            decode(FollowState, sample.payload.to_bytes(), str(sample.encoding))
        )  # fmt: skip

    def _hear(self, sample: zenoh.Sample) -> None:
        self.health = decode(Health, sample.payload.to_bytes(), str(sample.encoding))

    def says(self, words: str) -> bool:
        """Whether health is degraded for that reason."""
        health = self.health
        return health is not None and health.state == "degraded" and words in health.reason

    def follow(self) -> FollowState:
        """Choose the one person and wait until the robot drives."""
        self.until("a first state", lambda state: state.state == "idle")
        self.choose(TargetRequest(mode="id", track_id=1))
        return self.until("driving", lambda state: state.linear_mps > 0.5)

    def put(self, key: str, message: Message, stamped: bool = True) -> None:
        stamp = Stamp(producer=TRACKER, t_sent_ns=time.time_ns(), age_ns=0)
        self.session.put(
            key, encode(message), encoding=message.encoding(),
            attachment=encode(stamp) if stamped else None,
        )  # fmt: skip

    def until(
        self,
        what: str,
        condition: Callable[[FollowState], bool],
        *beside: tuple[str, Message | Callable[[], Message]],
    ) -> FollowState:
        """Send good tracks, and more, until a state like that is told."""

        def told() -> bool:
            self.seq += 1
            self.put(keys.tracks("front"), self.picture())
            for key, given in beside:
                message = given if isinstance(given, Message) else given()
                self.put(key, message.model_copy(update={"seq": self.seq}))
            time.sleep(_PERIOD_S)
            return bool(self.states) and condition(self.states[-1])

        network.wait_until(told, what)
        return self.states[-1]

    def picture(self) -> Tracks:
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
    command = ("-m", "heel", "follow", "3", "4", "--connect", robot.endpoint)
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


def beacon(age_s: float) -> Callable[[], Taken]:
    """What a camera of this host says of a frame that it took so long ago."""
    return lambda: Taken(
        stream="front", epoch=1, seq=0, clock=monotonic_clock(),
        monotonic_ns=time.monotonic_ns() - round(age_s * 1e9),
    )  # fmt: skip


def test_time_that_frames_spent_on_links_stops_the_robot(robot: Robot) -> None:
    robot.follow()
    late = robot.until(
        "old frames", lambda state: (state.tracks_age_s or 0.0) > 0.7,
        (keys.taken("front"), beacon(0.8)),
    )  # fmt: skip
    assert (late.state, late.linear_mps, late.angular_radps) == ("lost", 0.0, 0.0)
    assert late.reason == "tracks are older than 0.22 s"
    robot.until("driving again", lambda state: state.linear_mps > 0.5,
                (keys.taken("front"), beacon(0.02)))  # fmt: skip
    network.wait_until(
        lambda: robot.health is not None and robot.health.details.get("ages") == "from acquisition",
        "the health that says how ages are bounded",
    )


def test_a_frozen_frame_under_other_epochs_does_not_keep_the_robot_moving(robot: Robot) -> None:
    robot.follow()
    frozen = robot.picture()
    ends_s = time.monotonic() + 1.5
    while time.monotonic() < ends_s:
        for epoch in (2, 1, time.monotonic_ns()):
            robot.put(keys.tracks("front"), frozen.model_copy(update={"epoch": epoch}))
            time.sleep(_PERIOD_S)
    assert robot.states[-1].reason == "tracks are older than 0.22 s"
    assert robot.says("every message is refused")
    robot.until("driving again", lambda state: state.linear_mps > 0.5)
    # Nor does one frame from the end of all numbers keep out the true ones.
    robot.put(keys.tracks("front"), frozen.model_copy(update={"seq": 2**63 - 1}))
    told = len(robot.states)
    robot.until("more states", lambda _: len(robot.states) > told + 5)
    # A busy machine may be late with a picture, but what came after that frame still counts.
    robot.until("still following", lambda state: state.state == "following")


def test_ranges_that_cannot_be_read_stop_the_robot_from_the_first_on(robot: Robot) -> None:
    robot.follow()

    def garbage() -> None:
        robot.session.put(keys.ROBOT_RANGE, b"\xc1", encoding=Ranges.encoding())

    def stands(state: FollowState) -> bool:
        garbage()
        return state.state == "stopped"

    stopped = robot.until("a stop", stands)
    assert stopped.reason.startswith("ranges cannot be read: stamp: not msgpack")
    robot.until("health", lambda state: stands(state) and robot.says("ranges cannot be read"))
    robot.until("driving again", lambda state: state.linear_mps > 0.5)


def test_another_lens_in_the_middle_is_not_believed(robot: Robot) -> None:
    unmounted = {"mount_height_m": None, "mount_pitch_rad": None}
    wide = INFO.model_copy(update=unmounted | {"horizontal_fov_rad": 1.0})
    robot.put(keys.info("front"), wide, stamped=False)
    plain = robot.follow()
    narrow = wide.model_copy(update={"horizontal_fov_rad": 0.2})
    robot.put(keys.info("front"), narrow, stamped=False)
    robot.until("health", lambda _: robot.says("two descriptions"))
    assert robot.states[-1].distance_m == pytest.approx(plain.distance_m, rel=0.2)


def test_a_follower_that_waits_for_latched_values_ends_by_itself_when_told_to() -> None:
    asked, kept = threading.Event(), []

    def keep(query: zenoh.Query) -> None:
        # A question that is neither answered nor dropped stays open for those who asked it.
        kept.append(query)
        asked.set()

    with network.router() as endpoint, network.client(endpoint) as session:
        queryable = session.declare_queryable("**", keep)
        with running("-m", "heel.services.follower", "--connect", endpoint) as follower:
            assert asked.wait(30.0), follower.stderr()
            code, _ = follower.stop(signal.SIGTERM, network.DEADLINE_S)
            assert "forced exit" not in follower.stderr()
            assert code == 0, follower.stderr()
        queryable.undeclare()


def test_another_camera_takes_over_the_person_that_leaves_the_picture() -> None:
    with ExitStack() as resources:
        endpoint = resources.enter_context(network.router())
        robot = Robot(endpoint, resources, "--cameras", "side")
        for info in (FRONT, SIDE):
            robot.put(keys.info(info.stream), info, stamped=False)

        def looking(*names: str) -> None:
            robot.seq += 1
            for name, info, tracker, number in (
                ("front", FRONT, TRACKER, 1), ("side", SIDE, SIDE_TRACKER, 11),
            ):  # fmt: skip
                people = [seen(number, *OVERLAP, info)] if name in names else []
                stamp = Stamp(producer=tracker, t_sent_ns=time.time_ns(), age_ns=0)
                message = frame(info, robot.seq, *people)
                robot.session.put(
                    keys.tracks(name), encode(message), encoding=message.encoding(),
                    attachment=encode(stamp),
                )  # fmt: skip
            time.sleep(_PERIOD_S)

        def sights() -> str:
            return "" if robot.health is None else robot.health.details.get("sights", "")

        def once(what: str, told: Callable[[], bool], *names: str) -> None:
            network.wait_until(lambda: looking(*names) or told(), what)

        once("a first state", lambda: bool(robot.states), "front", "side")
        robot.choose(TargetRequest(mode="id", track_id=1))
        once("two cameras agree", lambda: sights() == "front, also side 11", "front", "side")
        once("the other camera", lambda: robot.states[-1].target.track_id == 11, "side")
        assert robot.states[-1].target.tracker == SIDE_TRACKER
        # A click on the first camera's page turns back to it.
        once("both", lambda: sights().startswith("side"), "front", "side")
        robot.choose(TargetRequest(mode="id", track_id=1, tracker=TRACKER))
        once("the first camera", lambda: robot.states[-1].target.tracker == TRACKER, "front")
