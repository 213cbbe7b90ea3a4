"""Whatever happens in whatever order: limits hold, doubt means zero, nobody else is followed."""

from __future__ import annotations

import math

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from schemas import MotionCommand, TargetRequest, Track, decode, encode
from services.follower.core import Follower, TargetError
from services.follower.settings import FollowerSettings
from tests.unit.follower.people import OTHER_TRACKER, TRACKER, person, tracks

_ROUNDING = 1e-9

_RARELY = st.integers(0, 9).map(lambda die: die == 0)
_SETTINGS = st.builds(
    FollowerSettings,
    target=st.sampled_from(["none", "nearest"]),
    max_tracks_age_s=st.sampled_from([0.05, 0.3, 1.0]),
    max_linear_mps=st.sampled_from([0.0, 0.8, 5.0]),
    max_reverse_mps=st.sampled_from([0.0, 0.5, 5.0]),
    max_angular_radps=st.sampled_from([0.0, 1.2, 10.0]),
    max_linear_mps2=st.floats(0.1, 20.0),
    max_angular_radps2=st.floats(0.1, 50.0),
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
    identity_confidence=st.sampled_from([0.0, 0.5, 0.6, 1.0]),
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
    st.sampled_from([TargetRequest(mode="nearest"), TargetRequest(mode="none")]),
)


class AnyOrder(RuleBasedStateMachine):
    """Drives a follower as its service would, with a model of what it is allowed to do."""

    @initialize(chosen=_SETTINGS)
    def start(self, chosen: FollowerSettings) -> None:
        self.settings = chosen
        self.follower = Follower(chosen)
        self.now_s = 100.0
        self.fresh_s: float | None = None
        self.estop = False
        self.waits_for_nearest = chosen.target == "nearest"
        self.chosen_id: int | None = None
        self.chosen_by: str | None = None
        self.tracker: str | None = None
        self.people: set[int] = set()
        self.before: MotionCommand | None = None
        self.command: MotionCommand | None = None
        self.dt_s = 0.0

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

    @rule(people=st.lists(_USUAL, min_size=1, max_size=2, unique_by=lambda track: track.id))
    def people_walk(self, people: list[Track]) -> None:
        """Some good frames at 25 Hz; who is seen is chosen if nobody was."""
        for _ in range(4):
            self.tracks_arrive(people, False, 0.02)
            if self.chosen_id not in self.people:
                self.somebody_chooses(TargetRequest(mode="id", track_id=people[0].id))
            self.time_passes(0.02, 2)

    @rule(request=_REQUESTS)
    def somebody_chooses(self, request: TargetRequest) -> None:
        """A choice; what was refused must change nothing."""
        try:
            target = self.follower.choose(request)
        except TargetError:
            return
        assert request.tracker in (None, self.tracker), "an id of another tracker"
        self.waits_for_nearest = target.mode == "nearest" and target.track_id is None
        self.chosen_id = target.track_id
        self.chosen_by = self.tracker
        if request.mode == "id":
            assert target.track_id == request.track_id

    @rule(engaged=_RARELY | st.booleans())
    def estop_changes(self, engaged: bool) -> None:
        """Engaged or released by somebody."""
        self.follower.set_estop(engaged)
        self.estop = engaged

    @rule(fov_rad=st.floats(0.1, 3.1))
    def camera_is_described(self, fov_rad: float) -> None:
        """The camera states its field of view."""
        self.follower.set_field_of_view(fov_rad)

    @rule(gap_s=st.sampled_from([0.02, 0.02, 0.02, 0.0, -0.5, 0.3, 10.0]), ticks=st.integers(1, 5))
    def time_passes(self, gap_s: float, ticks: int) -> None:
        """Timer ticks, also late ones and a clock that stands or steps back."""
        for _ in range(ticks):
            last_s, self.now_s = self.now_s, self.now_s + gap_s
            self.dt_s = max(0.0, self.now_s - last_s)
            age_s = None if self.fresh_s is None else max(0.0, self.now_s - self.fresh_s)
            self.before, self.command = self.command, self.follower.step(self.now_s, age_s)
            self._check(self.command, age_s)

    def _check(self, command: MotionCommand, age_s: float | None) -> None:
        self._within_limits(command)
        moves = bool(command.linear_mps or command.angular_radps)
        assert moves <= (command.state == "following")
        if self.estop:
            assert (moves, command.state) == (False, "stopped")
        if age_s is None or age_s > self.settings.max_tracks_age_s:
            assert not moves
        if command.state == "following":
            self._follows_the_chosen_one()
        assert decode(MotionCommand, encode(command)) == command

    def _within_limits(self, command: MotionCommand) -> None:
        s = self.settings
        linear, angular = command.linear_mps, command.angular_radps
        assert math.isfinite(linear)
        assert math.isfinite(angular)
        assert -s.max_reverse_mps - _ROUNDING <= linear <= s.max_linear_mps + _ROUNDING
        assert abs(angular) <= s.max_angular_radps + _ROUNDING
        before = (self.before.linear_mps, self.before.angular_radps) if self.before else (0.0, 0.0)
        if (linear, angular) != (0.0, 0.0):
            assert abs(linear - before[0]) <= s.max_linear_mps2 * self.dt_s + _ROUNDING
            assert abs(angular - before[1]) <= s.max_angular_radps2 * self.dt_s + _ROUNDING

    def _follows_the_chosen_one(self) -> None:
        followed = self.follower.target.track_id
        assert followed in self.people
        if self.waits_for_nearest:
            # The first person seen well is the choice from then on.
            self.chosen_id, self.chosen_by = followed, self.tracker
            self.waits_for_nearest = False
        assert followed == self.chosen_id
        assert self.tracker == self.chosen_by, "the same number, another tracker's person"

    @invariant()
    def no_id_comes_by_itself(self) -> None:
        if not self.waits_for_nearest:
            assert self.follower.target.track_id in (None, self.chosen_id)


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(
    max_examples=80, stateful_step_count=30, deadline=None, derandomize=True,
    suppress_health_check=list(HealthCheck),
)  # fmt: skip


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.lists(_PEOPLE, min_size=1, max_size=30))
def test_other_people_never_change_how_the_chosen_one_is_followed(
    frames: list[list[Track]],
) -> None:
    """A follower that sees everybody does what one does that sees the chosen person only."""
    sees_all, sees_one = Follower(FollowerSettings()), Follower(FollowerSettings())
    for made in (sees_all, sees_one):
        made.observe(tracks(person(1)), TRACKER)
        made.choose(TargetRequest(mode="id", track_id=1))
    for number, people in enumerate(frames):
        sees_all.observe(tracks(*people), TRACKER)
        sees_one.observe(tracks(*(track for track in people if track.id == 1)), TRACKER)
        now_s = 10.0 + number * 0.04
        assert sees_all.step(now_s, 0.02) == sees_one.step(now_s, 0.02)
