"""The follower: which person, may the robot move, and how. No transport, no clock of its own."""

from __future__ import annotations

import math

from heel.schemas import (
    CameraInfo,
    FollowState,
    FrameId,
    Manual,
    MotionCommand,
    Odometry,
    Pointed,
    Ranges,
    Target,
    TargetRequest,
    Track,
    Tracks,
)
from heel.schemas.follow import FollowStateName
from heel.services.follower.camera_info import implausible
from heel.services.follower.clearance import Sectors, Watched
from heel.services.follower.freshness import Freshness
from heel.services.follower.kept import KeptTarget
from heel.services.follower.manual import ManualDrive, ManualError
from heel.services.follower.moving_picture import PictureWatch
from heel.services.follower.own_motion import OwnMotion, Pose
from heel.services.follower.people import People
from heel.services.follower.pursuit import Pursued, Pursuit
from heel.services.follower.search import Search, all_around, search_for
from heel.services.follower.sensors import (
    MAX_ODOMETRY_AGE_S,
    Sensor,
    Sensors,
    implausible_odometry,
    implausible_ranges,
)
from heel.services.follower.settings import FollowerSettings
from heel.services.follower.sight import Sight, judge_sight
from heel.services.follower.states import Situation, by_hand, next_state
from heel.services.follower.surroundings import Surroundings
from heel.services.follower.target import TargetChoice, TargetError

_MAX_STEP_S = 0.2
"""Seconds that one step of the controller spans at most, however late it comes; chosen by hand."""
_SEARCH_SWEEP_RAD = 0.6
"""The search looks so far to either side of where the person should be; chosen by hand."""

_SEARCHES: tuple[FollowStateName, ...] = ("following", "occluded", "unsure")
"""States from which somebody who goes out of sight is looked for, so after a gap as well."""


class Follower:
    """Turns tracks into motion commands for one chosen person.

    Call `observe` for every tracks message, `observe_ranges` and `observe_odometry` where there
    are any, and `step` at a fixed rate. It never changes to another person by itself: a target
    that is gone stays chosen until another one is chosen.
    """

    def __init__(self, settings: FollowerSettings, first_seq: int = 0) -> None:
        self.settings = settings
        self._people = People(settings.person_height_m, math.radians(settings.horizontal_fov_deg))
        self._motion = OwnMotion(settings.robot_delay_s, MAX_ODOMETRY_AGE_S)
        self._surroundings = Surroundings(settings)
        self._watched = Watched()
        self._pursuit = Pursuit(settings, self._people, self._motion, self._surroundings)
        self._sensors = Sensors(settings)
        self._choice = TargetChoice(settings)
        self._picture = PictureWatch()
        self._freshness = Freshness(settings.max_tracks_age_s, settings.confirm_s)
        self._search: Search | None = None
        self._around: Search | None = None
        self._asked_s: float | None = None
        self._tracks: Tracks | None = None
        self._tracks_s = -math.inf
        self._tracks_are_new = False
        self._heading_rad = 0.0
        self._estop = False
        self._manual = ManualDrive()
        self._forget_sight()
        self._name: FollowStateName = "idle"
        self._unsought = False
        self._since_s = 0.0
        self._now_s: float | None = None
        self._seq = first_seq
        self.state = FollowState(
            seq=0, state="idle", reason="started", estop=False, target=self.target,
            linear_mps=0.0, angular_radps=0.0,
        )  # fmt: skip

    @property
    def next_seq(self) -> int:
        """Number of the next command."""
        return self._seq

    @property
    def target(self) -> Target:
        """What is being followed."""
        return self._choice.target

    def set_camera(self, info: CameraInfo) -> None:
        """Use what the camera says of itself: field of view, mounting height and pitch.

        What no camera can be like is not used, and the robot stands for a while.
        """
        now_s = self._now_s or 0.0
        if problem := implausible(info):
            self.refuse("camera", problem, now_s)
            return
        self._sensors.good("camera", now_s)
        self._people.set_camera(info)

    def refuse(self, sensor: Sensor, reason: str, now_s: float, known: bool = True) -> None:
        """Take note of a message that cannot be used; without good ones beside it the robot stops.

        Args:
            sensor: that it came from.
            reason: in words.
            now_s: time of arrival, on the clock of `step`.
            known: whether it names its sender, and is newer than all before.
        """
        self._sensors.refused(sensor, reason, now_s, known)

    def trouble(self, now_s: float) -> str:
        """Which sensor speaks and cannot be read, in words; "" if none."""
        return self._sensors.trouble(now_s)

    def set_estop(self, engaged: bool) -> None:
        """Engage or release the emergency stop; it holds whatever else happens."""
        self._estop = engaged
        if engaged:
            self._manual.stopped()

    def take_by_hand(self, grant: str, source: str, now_s: float) -> None:
        """From now on the robot goes where wishes with this grant tell it, and else stands.

        Args:
            grant: a new one.
            source: who drives, in words.
            now_s: monotonic time.

        Raises:
            ManualError: somebody else drives at this moment, or the settings forbid it.
        """
        if not self.settings.manual_linear_mps and not self.settings.manual_angular_radps:
            raise ManualError(
                "driving by hand is forbidden: manual_linear_mps and manual_angular_radps are 0"
            )
        self._manual.take(grant, source, now_s)

    def hand_back(self, now_s: float) -> None:
        """Follow again, after making sure of the person.

        Raises:
            ManualError: somebody drives at this moment.
        """
        if self._manual.taken:
            self._manual.hand_back(now_s)
            self._begin()

    def observe_wish(self, wish: Manual, measured_s: float, now_s: float) -> str:
        """Take what a hand wishes; returns why it does not count, "" if it does.

        Args:
            wish: as decoded.
            measured_s: when the hand was there at the earliest, monotonic.
            now_s: monotonic time of its arrival.
        """
        return self._manual.wish(wish, measured_s, now_s)

    def pose_at(self, t_s: float) -> Pose:
        """Where the robot was at a time, on the clock of `step`."""
        return self._motion.pose_at(t_s)

    @property
    def decided(self) -> bool:
        """Whether one person is chosen, for good."""
        choice = self._choice
        return (
            choice.target.track_id is not None
            and choice.provisional is None and choice.pending is None
        )  # fmt: skip

    def hand_over(self, tracks: Tracks, tracker: str, track_id: int, words: str) -> None:
        """Go on with the same person as another camera sees it; that camera is set already.

        Args:
            tracks: its newest frame, with the person in it.
            tracker: name of its tracker.
            track_id: of the person there.
            words: why, for people.
        """
        self._choice.hand_over(tracks, tracker, track_id, words)
        self._people.clear()
        self._picture.restart()
        self._tracks, self._tracks_are_new = tracks, True

    def observe(self, tracks: Tracks, tracker: str) -> None:
        """Take the tracks of a frame.

        Args:
            tracks: the frame's people.
            tracker: the producer that gave out the ids; another one makes the chosen id void,
                and so does another camera, or the same one started anew.
        """
        if self._choice.source_is(tracker, tracks):
            self._people.clear()
            self._freshness.restart()
            self._begin()
        self._tracks, self._tracks_are_new = tracks, True

    def observe_ranges(self, ranges: Ranges, now_s: float) -> None:
        """Take free distances; from the first on, the robot moves only while they are fresh.

        Args:
            ranges: what a range sensor sees around the robot now.
            now_s: time of arrival, on the clock of `step`.
        """
        if problem := implausible_ranges(ranges):
            self.refuse("ranges", problem, now_s)
            return
        self._sensors.good("ranges", now_s)
        sectors = Sectors(ranges, self._watched)
        self._surroundings.observe(sectors, now_s)
        self._people.observe(sectors, now_s)

    def observe_odometry(self, odometry: Odometry, now_s: float) -> None:
        """Take the robot's own motion; without it the commands stand for it.

        Args:
            odometry: what the robot does now.
            now_s: time of arrival, on the clock of `step`.
        """
        if problem := implausible_odometry(odometry):
            self.refuse("odometry", problem, now_s)
            return
        self._sensors.good("odometry", now_s)
        self._motion.odometry(odometry, now_s)

    def choose(self, request: TargetRequest) -> Target:
        """Choose or clear the target.

        A point without a track stays pending: a person that comes to be tracked there within
        some seconds is chosen, and until then the target has no id.

        To choose somebody while the robot is driven by hand hands it back, too.

        Raises:
            TargetError: the id is unknown or another tracker's, what is seen is too old to choose
                from, or a hand drives at this moment.
        """
        now_s = self._now_s or 0.0
        if self._manual.taken and request.mode != "none":
            try:
                self.hand_back(now_s)
            except ManualError as error:
                raise TargetError(str(error)) from None
        age_s = 0.0 if self._tracks_are_new else now_s - self._tracks_s
        if self._choice.request(request, self._tracks, age_s, now_s):
            self._begin()
        return self.target

    @property
    def kept(self) -> KeptTarget | None:
        """What the next follower has to know to follow the same person; none by hand.

        A follower that starts again knows of no hand: it must not set off by itself.
        """
        return None if self._manual.taken else self._choice.kept

    def restore(self, kept: KeptTarget) -> None:
        """Before the first tracks: go on with the person that the follower before followed.

        It counts if they are the same tracker's, of the same pictures; and the robot moves only
        after making sure, as with every person that is chosen.
        """
        self._choice.restore(kept)

    @property
    def too_slow(self) -> str | None:
        """What of the camera keeps the robot from moving: its rate, or how late tracks come."""
        return self._freshness.cause

    @property
    def swings(self) -> str | None:
        """That the robot has been turning to and fro before a person, and what helps; else None."""
        if not self._pursuit.swings:
            return None
        return (
            "the robot swings: it turns later than robot_delay_s says "
            f"({self.settings.robot_delay_s:g} s): measure that, or publish robot/odometry"
        )

    @property
    def pointed(self) -> Pointed | None:
        """What the detector is told: a person may be where a user pointed. None without a point."""
        tracks, pending = self._tracks, self._choice.pending
        if tracks is None or pending is None:
            return None
        x_px, y_px = pending.place_px
        return Pointed(
            frame=tracks.frame_id(),
            width=tracks.width, height=tracks.height, x_px=x_px, y_px=y_px,
        )  # fmt: skip

    def step(self, now_s: float, tracks_age_s: float | None) -> MotionCommand:
        """The command of this moment.

        Args:
            now_s: monotonic or stream time, not before that of the last step.
            tracks_age_s: age of the newest tracks, None before the first.
        """
        now_s = now_s if self._now_s is None else max(now_s, self._now_s)
        dt_s = 0.0 if self._now_s is None else min(_MAX_STEP_S, now_s - self._now_s)
        self._now_s = now_s
        self._motion.advance(now_s)
        self._take_tracks(now_s, tracks_age_s)
        self._choice.give_up(now_s)
        situation = self._situation(now_s, tracks_age_s)
        if self._manual.taken:
            words = f"driven by hand: {self._manual.source}"
            name, reason = by_hand(situation, self.settings, words)
        else:
            name, reason = next_state(self._name, situation, self.settings)
        self._enter(name, now_s)
        if self._manual.taken:
            linear_mps, angular_radps = self._drive_by_hand(now_s, dt_s)
        else:
            linear_mps, angular_radps = self._drive(now_s, dt_s)
        self._motion.told(now_s, linear_mps, angular_radps)
        self._remember(reason, tracks_age_s, linear_mps, angular_radps)
        self._seq += 1
        return MotionCommand(
            seq=self._seq - 1, linear_mps=linear_mps, angular_radps=angular_radps,
            ttl_s=self.settings.ttl_s, state=name, reason=reason, frame=self._frame(),
            manual=self._manual.taken,
        )  # fmt: skip

    def halt(self, reason: str) -> MotionCommand:
        """A command to stand, where `step` fails to give one."""
        self._pursuit.stand()
        self._name = "stopped"
        self._seq += 1
        self.state = self.state.model_copy(
            update={
                "seq": self._seq, "state": "stopped", "reason": reason, "linear_mps": 0.0,
                "angular_radps": 0.0, "estop": self._estop,
            }
        )  # fmt: skip
        return MotionCommand(
            seq=self._seq - 1, linear_mps=0.0, angular_radps=0.0, ttl_s=self.settings.ttl_s,
            state="stopped", reason=reason[:96],
        )  # fmt: skip

    def _begin(self) -> None:
        """Another person or none: what was known of the old one's sight means nothing."""
        self._forget_sight()
        self._pursuit.begin()
        self._picture.restart()
        self._around = self._asked_s = None
        self._name, self._unsought = "idle", False

    def _forget_sight(self) -> None:
        self._seen_s = -math.inf
        self._clear_since_s: float | None = None

    def _take_tracks(self, now_s: float, tracks_age_s: float | None) -> None:
        if not self._tracks_are_new or self._tracks is None or tracks_age_s is None:
            return
        self._tracks_are_new = False
        self._tracks_s = now_s - tracks_age_s
        self._freshness.frame(self._tracks_s, tracks_age_s)
        self._people.update(self._tracks, self._tracks_s, self._motion, self.target.track_id)
        target = self._people.seen.get(self.target.track_id or 0)
        if target is not None:
            self._pursuit.seen_at(target.filter.place_at(self._tracks_s))
        self._watch_picture(self._tracks)
        turned_rad = self._turned_rad()
        self._choice.carry(self._tracks, turned_rad, self._people.focal_px)
        if tracks_age_s > self.settings.max_tracks_age_s:
            self._choice.interrupted()
        elif self._choice.settle(self._tracks, self._people.seen.values(), self._tracks_s):
            self._begin()

    def _watch_picture(self, tracks: Tracks) -> None:
        person = self._people.seen.get(self.target.track_id or 0)
        pose = self._motion.pose_at(self._tracks_s)
        target = None if person is None else self._track()
        distance_m = math.inf if person is None else person.distance_m
        self._picture.frame(tracks, self._tracks_s, target, distance_m, pose)

    def _turned_rad(self) -> float:
        """How far the robot turned between the newest two frames."""
        before_rad = self._heading_rad
        self._heading_rad = self._motion.pose_at(self._tracks_s).heading_rad
        return self._heading_rad - before_rad

    def _situation(self, now_s: float, tracks_age_s: float | None) -> Situation:
        sight, why = self._sight()
        if sight in ("clear", "doubtful") and self._asks_who_is_back():
            sight, why = self._sight()
        if sight in ("clear", "doubtful"):
            self._seen_s = self._tracks_s
        track, target = self._track(), self.target
        proven = track is None or track.proven
        # While it may be a thing, its confidence is low; time in sight counts all the same, so
        # that proof, which itself takes time, lets the robot start at once.
        if sight != "clear" and (proven or sight != "doubtful"):
            self._clear_since_s = None
        elif self._clear_since_s is None:
            self._clear_since_s = self._tracks_s
        since_s = self._clear_since_s
        trusted = self._name in ("following", "occluded")
        stale = None if tracks_age_s is None else self._freshness.judge(now_s, tracks_age_s)
        if stale is not None and self._name in _SEARCHES:
            self._unsought = True
        return Situation(
            estop=self._estop,
            unreadable=self._sensors.trouble(now_s),
            ranges_stale=self._surroundings.stale(now_s),
            chosen=target.mode != "none",
            chosen_reason=target.reason,
            target_id=target.track_id,
            tracks_age_s=tracks_age_s,
            sight=sight,
            sight_reason=why,
            clear_s=0.0 if since_s is None else self._tracks_s - since_s,
            unseen_s=now_s - self._seen_s,
            searching_s=now_s - self._since_s if self._name == "searching" else 0.0,
            looked_everywhere=target.track_id not in self._people.known
            or (self._search is not None and self._search.over),
            on_way=trusted and self._pursuit.on_way(self._pursued(now_s)),
            looks_around=self._looks_around(now_s),
            undecided=target.reason if self._choice.provisional is not None else "",
            proven=proven,
            stale=stale,
            frozen=self._picture.frozen,
            unsought=self._unsought,
        )

    def _sight(self) -> tuple[Sight, str]:
        """How well the target is seen in the newest frame, and why not better."""
        located = self.target.track_id in self._people.seen
        trusted = self._name in ("following", "occluded")
        return judge_sight(self._track(), located, trusted, self.settings)

    def _asks_who_is_back(self) -> bool:
        """Whether the target was out of sight for so long that a user has to choose again."""
        away_s, most_s = self._tracks_s - self._seen_s, self.settings.ask_after_s
        if not 0.0 < most_s <= away_s < math.inf:
            return False
        self._choice.ask_again(away_s)
        self._begin()
        return True

    def _looks_around(self, now_s: float) -> bool:
        """Whether to turn round once for the first person, none being in view since asked to."""
        if self._asked_s is None:
            self._asked_s = now_s
        searching_s = now_s - self._since_s if self._name == "searching" else 0.0
        if self._around is not None and searching_s >= self.settings.search_s:
            self._around.give_up()
        return (
            self.target.mode == "nearest"
            and now_s - self._asked_s > self.settings.hold_s
            and not (self._around is not None and self._around.over)
        )

    def _enter(self, name: FollowStateName, now_s: float) -> None:
        if name != self._name:
            self._name, self._since_s, self._search = name, now_s, None
        if name != "lost":
            self._unsought = False
        if name != "searching" or self._search is not None:
            return
        pose = self._motion.pose
        if self.target.track_id is None:
            # Where a stop has interrupted it, the turn is gone on with.
            self._search = self._around = self._around or all_around(pose)
            return
        place = self._people.known[self.target.track_id].filter
        expected = place.place_at(now_s)
        _, sideways = pose.turned(*place.velocity)
        _, left = pose.seen(*expected)
        side = math.copysign(1.0, sideways if abs(sideways) > 0.2 else left)
        last_seen = place.place_at(place.t_s)
        self._search = search_for(pose, expected, last_seen, side, _SEARCH_SWEEP_RAD)

    def _drive(self, now_s: float, dt_s: float) -> tuple[float, float]:
        """Velocity of the present state: `following` and `occluded` drive, two turn on the spot."""
        if self._name == "searching" and self._search is not None:
            return self._pursuit.turn_to(self._search.bearing_rad(self._motion.pose_soon()), dt_s)
        target = self._pursued(now_s)
        if self._name == "acquiring" and self._may_be_a_thing():
            return self._pursuit.turn_to(self._pursuit.goal(target).bearing_rad, dt_s)
        if self._name not in ("following", "occluded"):
            return self._pursuit.stand()
        return self._pursuit.follow(target, self._name == "following", dt_s)

    def _drive_by_hand(self, now_s: float, dt_s: float) -> tuple[float, float]:
        """Velocity that the hand wishes."""
        if self._estop:
            self._manual.stopped()
        wished = self._manual.wished(now_s)
        if wished is None or self._name != "idle":
            return self._pursuit.stand()
        return self._pursuit.by_hand(wished, now_s, dt_s)

    def _may_be_a_thing(self) -> bool:
        """Whether the target is in sight, but not proven to be a person."""
        track = self._track()
        return track is not None and not track.proven and track.id in self._people.seen

    def _pursued(self, now_s: float) -> Pursued:
        """The chosen person, as driving has to know them."""
        track = self._track()
        return Pursued(
            track_id=self.target.track_id,
            now_s=now_s,
            unseen_s=now_s - self._seen_s,
            missing=self._seen_s < self._tracks_s,
            behind_people=track is not None and bool(track.occluded_by),
        )

    def _track(self) -> Track | None:
        tracks = () if self._tracks is None else self._tracks.tracks
        return next((track for track in tracks if track.id == self.target.track_id), None)

    def _frame(self) -> FrameId | None:
        t = self._tracks
        if t is None:
            return None
        return FrameId(
            stream=t.stream, epoch=t.epoch, seq=t.seq, index=t.index, t_capture_ns=t.t_capture_ns
        )

    def _remember(
        self, reason: str, tracks_age_s: float | None, linear_mps: float, angular_radps: float
    ) -> None:
        now_s = self._now_s or 0.0
        track, seen = self._track(), self._people.seen.get(self.target.track_id or 0)
        ahead_m, left_m = (0.0, 0.0)
        if seen is not None:
            ahead_m, left_m = self._motion.pose.seen(*seen.filter.place_at(now_s))
        nearest_m = min(
            (math.hypot(*self._motion.pose.seen(*person.filter.place_at(now_s)))
             for person in self._people.seen.values()), default=None,
        )  # fmt: skip
        free_m, pending = self._surroundings.free_ahead_m(now_s), self._choice.pending
        self.state = FollowState(
            seq=self._seq, state=self._name, reason=reason, estop=self._estop, target=self.target,
            tracks_age_s=tracks_age_s, linear_mps=linear_mps, angular_radps=angular_radps,
            distance_m=None if seen is None else math.hypot(ahead_m, left_m),
            bearing_rad=None if seen is None else math.atan2(left_m, ahead_m),
            identity_confidence=None if track is None else track.identity_confidence,
            runner_up_confidence=None if track is None else track.runner_up_confidence,
            speed_reason=self._pursuit.speed_reason,
            pending_point_px=None if pending is None else pending.place_px,
            pending_for_s=None if pending is None else pending.for_s(now_s),
            obstacle_watch=free_m is not None, free_distance_m=free_m, nearest_person_m=nearest_m,
            driven_by=self._manual.source,
        )  # fmt: skip
