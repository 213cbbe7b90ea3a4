"""Whatever happens in whatever order: limits hold, doubt means zero, nobody else is followed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from heel.schemas import (
    CameraInfo,
    MotionCommand,
    Odometry,
    Ranges,
    TargetRequest,
    Track,
    decode,
    encode,
)
from heel.schemas.robot import RangeSector
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerSettings
from heel.services.follower.target import TargetError
from tests.unit.follower.people import OTHER_TRACKER, TRACKER, person, tracks
from tests.unit.follower.walking_world import INFO

_ROUNDING = 1e-6

_RARELY = st.integers(0, 9).map(lambda die: die == 0)
_SETTINGS = st.builds(
    FollowerSettings,
    target=st.sampled_from(["none", "nearest", "imprint"]),
    max_tracks_age_s=st.sampled_from([0.05, 0.3, 1.0]),
    max_linear_mps=st.sampled_from([0.0, 0.8, 5.0]),
    max_reverse_mps=st.sampled_from([0.0, 0.5, 5.0]),
    max_angular_radps=st.sampled_from([0.0, 1.2, 10.0]),
    max_linear_mps2=st.floats(0.1, 20.0),
    max_braking_mps2=st.floats(0.1, 20.0),
    max_linear_mps3=st.floats(0.5, 1000.0),
    max_angular_radps2=st.floats(0.1, 50.0),
    max_angular_radps3=st.floats(0.5, 1000.0),
    confirm_s=st.sampled_from([0.0, 0.02, 0.2]),
    hold_s=st.sampled_from([0.0, 0.3, 1.0]),
    search_s=st.sampled_from([0.0, 0.5, 10.0]),
    personal_space_m=st.sampled_from([0.0, 1.0]),
    robot_delay_s=st.sampled_from([0.0, 0.1, 1.0]),
    linear_gain_per_s=st.sampled_from([0.8, 10.0]),
    angular_gain_per_s=st.sampled_from([1.5, 10.0]),
    horizontal_fov_deg=st.floats(6.0, 174.0),
)
_USUAL = st.builds(
    person, track_id=st.integers(1, 3), x=st.floats(0, 640), height=st.floats(10, 480)
)
_COORDINATE = st.floats(-1e9, 1e9)
_ODD = st.builds(
    person,
    track_id=st.integers(1, 3),
    state=st.sampled_from(["new", "tracked", "tracked", "occluded", "lost"]),
    box_xyxy=st.tuples(_COORDINATE, _COORDINATE, _COORDINATE, _COORDINATE),
    identity_confidence=st.sampled_from([0.0, 0.5, 0.6, 0.7, 1.0]),
    runner_up_confidence=st.sampled_from([0.0, 0.0, 0.55]),
    shown=st.booleans(),
    distance_m=st.none() | st.floats(0, 1e12),
    bearing_rad=st.none() | st.floats(-1e9, 1e9),
)
_PEOPLE = st.lists(
    _USUAL | _USUAL | _ODD, min_size=1, max_size=3, unique_by=lambda track: track.id
) | st.just([])
_REQUESTS = st.one_of(
    st.builds(
        TargetRequest,
        mode=st.just("id"),
        track_id=st.integers(1, 5),
        tracker=st.sampled_from([None, TRACKER, OTHER_TRACKER]),
    ),
    st.builds(TargetRequest, mode=st.just("point"), x_px=st.floats(0, 640), y_px=st.floats(0, 480)),
    st.sampled_from([TargetRequest(mode=mode) for mode in ("nearest", "imprint", "none")]),
)
_SECTORS = st.lists(
    st.builds(
        RangeSector,
        bearing_rad=st.floats(-math.pi, math.pi),
        width_rad=st.floats(0.01, 2 * math.pi),
        distance_m=st.floats(0, 1000),
    ),
    max_size=5,
)
_FREE = RangeSector(bearing_rad=0.0, width_rad=6.0, distance_m=20.0)
_ODOMETRY = st.builds(
    Odometry, seq=st.just(0), x_m=_COORDINATE, y_m=_COORDINATE,
    heading_rad=st.floats(-math.pi, math.pi), linear_mps=_COORDINATE | st.floats(-2, 2),
    angular_radps=_COORDINATE | st.floats(-2, 2),
)  # fmt: skip
_CAMERAS = st.builds(
    lambda fov, height, pitch: INFO.model_copy(
        update={"horizontal_fov_rad": fov, "mount_height_m": height, "mount_pitch_rad": pitch}
    ),
    st.none() | st.floats(0.1, 3.1), st.none() | st.floats(0, 10), st.none() | st.floats(-2, 2),
)  # fmt: skip


class AnyOrder(RuleBasedStateMachine):
    """Drives a follower as its service would, with a model of what it is allowed to do."""

    @initialize(chosen=_SETTINGS)
    def start(self, chosen: FollowerSettings) -> None:
        self.settings = chosen
        self.follower = Follower(chosen)
        self.now_s = 100.0
        self.fresh_s: float | None = None
        self.estop = False
        self.waits = chosen.target != "none"
        self.ranges_s: float | None = None
        self.clear_s = -math.inf
        self.searching_since_s: float | None = None
        self.chosen_id: int | None = None
        self.chosen_by: str | None = None
        self.tracker: str | None = None
        self.people: set[int] = set()
        self.before: MotionCommand | None = None
        self.command: MotionCommand | None = None
        self.dt_s = self.clock_s = 0.0
        self.change = (0.0, 0.0)

    @rule(people=_PEOPLE, replaced=_RARELY, delay_s=st.sampled_from([0.0, 0.02, 0.2, 2.0]))
    def tracks_arrive(self, people: list[Track], replaced: bool, delay_s: float) -> None:
        """A frame's tracks, `delay_s` old on arrival, now and then of another tracker."""
        tracker = self.tracker or TRACKER
        if replaced:
            tracker = OTHER_TRACKER if tracker == TRACKER else TRACKER
        self.follower.observe(tracks(*people), tracker)
        self.tracker = tracker
        self.people = {track.id for track in people}
        self.fresh_s = self.now_s - delay_s

    @rule(
        people=st.lists(_USUAL, min_size=1, max_size=2, unique_by=lambda track: track.id),
        then=st.sampled_from(
            ["go on", "vanish", "hide", "doubt", "stop", "no tracks", "no ranges"]
        ),
        for_s=st.sampled_from([0.1, 0.5, 2.0, 15.0]),
    )
    def people_walk(self, people: list[Track], then: str, for_s: float) -> None:
        """Good frames at 25 Hz, the first one is chosen; then something happens to all."""
        if then != "stop":
            self.estop_changes(False)
        self._frames(people, 0.04, 12)
        changed = {
            "vanish": [],
            "hide": [track.model_copy(update={"state": "occluded"}) for track in people],
            "doubt": [track.model_copy(update={"identity_confidence": 0.3}) for track in people],
        }.get(then, people)
        if then == "stop":
            self.estop_changes(True)
        if then == "no ranges":
            self.ranges_arrive([_FREE], True)
            self.time_passes(for_s / 10, 10, people)
        elif then == "no tracks":
            self.time_passes(for_s / 10, 10)
        else:
            self._frames(changed, for_s / 10, 10)

    def _frames(self, people: list[Track], every_s: float, count: int) -> None:
        for _ in range(count):
            self.tracks_arrive(people, False, 0.02)
            if self.ranges_s is not None:
                self.ranges_arrive([_FREE], True)
            if people and self.chosen_id not in self.people and not self.waits:
                self.somebody_chooses(TargetRequest(mode="id", track_id=people[0].id))
            self.time_passes(every_s / 2, 2)

    @rule(request=_REQUESTS)
    def somebody_chooses(self, request: TargetRequest) -> None:
        """A choice; what was refused must change nothing."""
        try:
            target = self.follower.choose(request)
        except TargetError:
            return
        assert request.tracker in (None, self.tracker), "an id of another tracker"
        self.waits = target.mode in ("nearest", "imprint") and target.track_id is None
        self.chosen_id = target.track_id
        self.chosen_by = self.tracker
        if request.mode == "id":
            assert target.track_id == request.track_id

    @rule(engaged=_RARELY | st.booleans())
    def estop_changes(self, engaged: bool) -> None:
        """Engaged or released by somebody."""
        self.follower.set_estop(engaged)
        self.estop = engaged
        self.time_passes(0.02, 2)

    @rule(info=_CAMERAS)
    def camera_is_described(self, info: CameraInfo) -> None:
        """The camera states its field of view and mounting, or parts of them."""
        self.follower.set_camera(info)

    @rule(sectors=_SECTORS, rarely=_RARELY)
    def ranges_arrive(self, sectors: list[RangeSector], rarely: bool) -> None:
        """From the first on, the robot moves only while they are fresh; most runs have none."""
        if rarely or self.ranges_s is not None:
            self.follower.observe_ranges(Ranges(seq=0, sectors=tuple(sectors)), self.now_s)
            self.ranges_s = self.now_s

    @rule(odometry=_ODOMETRY)
    def odometry_arrives(self, odometry: Odometry) -> None:
        """What the robot says of itself, plausible or not."""
        self.follower.observe_odometry(odometry, self.now_s)

    @rule(gap_s=st.sampled_from([0.02, 0.02, 0.02, 0.0, -0.5, 0.3, 10.0]), ticks=st.integers(1, 5))
    def time_passes(self, gap_s: float, ticks: int, people: Sequence[Track] = ()) -> None:
        """Timer ticks, also late ones and a clock that stands or steps back."""
        for _ in range(ticks):
            self.now_s += gap_s
            if people:
                self.tracks_arrive(list(people), False, 0.02)
            self.dt_s = max(0.0, self.now_s - self.clock_s) if self.clock_s else 0.0
            self.clock_s = max(self.clock_s, self.now_s)
            age_s = None if self.fresh_s is None else max(0.0, self.now_s - self.fresh_s)
            self.before, self.command = self.command, self.follower.step(self.now_s, age_s)
            self._check(self.command, age_s)

    def _check(self, command: MotionCommand, age_s: float | None) -> None:
        self._within_limits(command)
        moves = bool(command.linear_mps or command.angular_radps)
        assert moves <= (command.state in ("following", "occluded", "searching"))
        if command.state == "searching":
            assert command.linear_mps == 0
        if self.estop:
            assert (moves, command.state) == (False, "stopped")
        if age_s is None or age_s > self.settings.max_tracks_age_s:
            assert not moves
        if self.ranges_s is not None:
            late_s = self.clock_s - self.ranges_s
            assert not (moves and late_s > self.settings.max_ranges_age_s)
        if command.state == "following":
            self._follows_the_chosen_one()
            self.clear_s = self.clock_s
        self._stands_in_time(command)
        assert decode(MotionCommand, encode(command)) == command

    def _stands_in_time(self, command: MotionCommand) -> None:
        """Out of sight for hold plus timeout: no forward speed; searched for long: none at all."""
        s = self.settings
        unseen_s = self.clock_s - self.clear_s
        if unseen_s > s.hold_s + s.max_tracks_age_s + _ROUNDING:
            assert command.linear_mps == 0
        if command.state != "searching":
            self.searching_since_s = None
        elif self.searching_since_s is None:
            self.searching_since_s = self.clock_s
        else:
            assert self.clock_s - self.searching_since_s < s.search_s

    def _within_limits(self, command: MotionCommand) -> None:
        s = self.settings
        linear, angular = command.linear_mps, command.angular_radps
        assert math.isfinite(linear)
        assert math.isfinite(angular)
        assert -s.max_reverse_mps - _ROUNDING <= linear <= s.max_linear_mps + _ROUNDING
        assert abs(angular) <= max(s.max_angular_radps, s.search_radps) + _ROUNDING
        before = (self.before.linear_mps, self.before.angular_radps) if self.before else (0.0, 0.0)
        limits = (
            (linear, max(s.max_linear_mps2, s.max_braking_mps2), s.max_linear_mps3),
            (angular, s.max_angular_radps2, s.max_angular_radps3),
        )
        changes = []
        for (value, most, jerk), last, change in zip(limits, before, self.change, strict=True):
            # A stop is free: at once, and from rest.
            if value == 0.0:
                changes.append(0.0)
                continue
            assert abs(value - last) <= most * self.dt_s + _ROUNDING
            if self.dt_s == 0:
                assert value == last
                changes.append(change)
                continue
            dt_s = min(self.dt_s, 0.2)
            now = (value - last) / dt_s
            assert abs(now - change) <= jerk * dt_s + _ROUNDING / dt_s
            changes.append(now)
        self.change = (changes[0], changes[1])

    def _follows_the_chosen_one(self) -> None:
        followed = self.follower.target.track_id
        assert followed in self.people
        if self.waits:
            # The first person seen well, or imprinted, is the choice from then on.
            self.chosen_id, self.chosen_by = followed, self.tracker
            self.waits = False
        assert followed == self.chosen_id
        assert self.tracker == self.chosen_by, "the same number, another tracker's person"

    @invariant()
    def no_id_comes_by_itself(self) -> None:
        if not self.waits:
            assert self.follower.target.track_id in (None, self.chosen_id)


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(
    max_examples=120, stateful_step_count=20, deadline=None, derandomize=True,
    suppress_health_check=list(HealthCheck),
)  # fmt: skip


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.lists(_PEOPLE, min_size=1, max_size=30))
def test_other_people_slow_the_robot_down_and_never_change_whom_it_follows(
    frames: list[list[Track]],
) -> None:
    """A follower that sees everybody is in the states of one that sees the chosen person only."""
    sees_all, sees_one = Follower(FollowerSettings()), Follower(FollowerSettings())
    for made in (sees_all, sees_one):
        made.observe(tracks(person(1)), TRACKER)
        made.choose(TargetRequest(mode="id", track_id=1))
    for number, people in enumerate(frames):
        sees_all.observe(tracks(*people), TRACKER)
        sees_one.observe(tracks(*(track for track in people if track.id == 1)), TRACKER)
        now_s = 10.0 + number * 0.04
        one, other = sees_all.step(now_s, 0.02), sees_one.step(now_s, 0.02)
        if one.state != "lost":  # How soon a search has looked everywhere depends on the heading.
            assert (one.state, one.reason) == (other.state, other.reason)
        assert sees_all.target == sees_one.target
