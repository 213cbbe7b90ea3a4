"""The follower: which person, may the robot move, and how. No transport, no clock of its own."""

from __future__ import annotations

import math

from schemas import (
    FollowState,
    FrameId,
    HeelError,
    MotionCommand,
    Target,
    TargetRequest,
    Track,
    Tracks,
)
from schemas.follow import FollowStateName
from services.follower import geometry
from services.follower.controller import VelocityController
from services.follower.settings import FollowerSettings

_MAX_STEP_S = 0.2


class TargetError(HeelError):
    """A target that cannot be chosen."""


class Follower:
    """Turns tracks into motion commands for one chosen person.

    Call `observe` for every tracks message and `step` at a fixed rate. It never changes to
    another person by itself: a target that is gone stays chosen until somebody chooses anew.
    """

    def __init__(self, settings: FollowerSettings) -> None:
        self.settings = settings
        self._controller = VelocityController(settings)
        self._fov_rad = math.radians(settings.horizontal_fov_deg)
        self._tracks: Tracks | None = None
        self._tracker: str | None = None
        self._target = Target(seq=0, mode=settings.target, reason="from the settings")
        self._estop = False
        self._seen_s = -math.inf
        self._now_s: float | None = None
        self._seq = 0
        self.state = FollowState(
            seq=0, state="idle", reason="started", estop=False, target=self._target,
            linear_mps=0.0, angular_radps=0.0,
        )  # fmt: skip

    @property
    def target(self) -> Target:
        """What is being followed."""
        return self._target

    def set_field_of_view(self, horizontal_fov_rad: float) -> None:
        """Use the camera's own field of view."""
        self._fov_rad = horizontal_fov_rad

    def set_estop(self, engaged: bool) -> None:
        """Engage or release the emergency stop; it holds whatever else happens."""
        self._estop = engaged

    def observe(self, tracks: Tracks, tracker: str) -> None:
        """Take the tracks of a frame.

        Args:
            tracks: the frame's people.
            tracker: the producer that gave out the ids; another one makes the chosen id void.
        """
        if self._tracker not in (None, tracker) and self._target.track_id is not None:
            self._choose("none", None, "the tracker was replaced: choose again")
        self._tracks, self._tracker = tracks, tracker

    def choose(self, request: TargetRequest) -> Target:
        """Choose or clear the target.

        Raises:
            TargetError: nobody is there, or the id is unknown or another tracker's.
        """
        if request.mode == "none":
            return self._choose("none", None, "cleared")
        track = self._requested(request)
        if track is None and request.mode == "nearest":
            return self._choose("nearest", None, "waiting for the first person")
        if track is None:
            raise TargetError(_not_found(request))
        return self._choose(request.mode, track.id, "chosen")

    def step(self, now_s: float, tracks_age_s: float | None) -> MotionCommand:
        """The command of this moment.

        Args:
            now_s: monotonic or stream time, not before that of the last step.
            tracks_age_s: age of the newest tracks, None before the first.
        """
        dt_s = 0.0 if self._now_s is None else min(_MAX_STEP_S, max(0.0, now_s - self._now_s))
        self._now_s = now_s
        track = self._acquire()
        state, reason = self._judge(track, now_s, tracks_age_s)
        if state == "following" and track is not None and self._tracks is not None:
            linear_mps, angular_radps = self._drive(track, self._tracks, dt_s)
        else:
            linear_mps, angular_radps = self._controller.stop()
        self._remember(state, reason, tracks_age_s, linear_mps, angular_radps)
        self._seq += 1
        return MotionCommand(
            seq=self._seq - 1, linear_mps=linear_mps, angular_radps=angular_radps,
            ttl_s=self.settings.ttl_s, state=state, reason=reason, frame=self._frame(),
        )  # fmt: skip

    def _requested(self, request: TargetRequest) -> Track | None:
        if self._tracks is None:
            return None
        if request.mode == "nearest":
            return geometry.nearest(self._tracks)
        if request.mode == "point" and request.x_px is not None and request.y_px is not None:
            return geometry.at_point(self._tracks, request.x_px, request.y_px)
        if request.tracker not in (None, self._tracker):
            raise TargetError(
                f"id {request.track_id} was given out by {request.tracker}, but {self._tracker} "
                "is tracking now: choose again"
            )
        return next((t for t in self._tracks.tracks if t.id == request.track_id), None)

    def _choose(self, mode: str, track_id: int | None, reason: str) -> Target:
        self._target = Target.model_validate(
            {"seq": self._target.seq + 1, "mode": mode, "track_id": track_id, "reason": reason,
             "tracker": self._tracker if track_id is not None else None}
        )  # fmt: skip
        self._seen_s = -math.inf
        return self._target

    def _acquire(self) -> Track | None:
        """The chosen person's track; picks the first one where `nearest` still waits."""
        if self._tracks is None:
            return None
        if self._target.mode == "nearest" and self._target.track_id is None:
            first = geometry.nearest(self._tracks)
            if first is not None:
                self._choose("nearest", first.id, "the nearest person")
        return next((t for t in self._tracks.tracks if t.id == self._target.track_id), None)

    def _judge(
        self, track: Track | None, now_s: float, tracks_age_s: float | None
    ) -> tuple[FollowStateName, str]:
        """State and reason; only `following` moves."""
        s = self.settings
        if self._estop:
            return "stopped", "emergency stop"
        if self._target.mode == "none":
            return "idle", self._target.reason[:96] or "no target"
        if tracks_age_s is None:
            return "acquiring", "no tracks yet"
        if not tracks_age_s <= s.max_tracks_age_s:
            return "lost", f"tracks are older than {s.max_tracks_age_s:g} s"
        if self._target.track_id is None:
            return "acquiring", "nobody in sight"
        if track is None or track.state == "lost" or not track.shown:
            missing = now_s - self._seen_s > s.lost_after_s
            return ("lost", "target lost") if missing else ("unsure", "target missed")
        self._seen_s = now_s
        if track.state == "occluded":
            return "occluded", "target occluded"
        if track.identity_confidence < s.min_identity_confidence:
            return "unsure", "identity unsure"
        return "following", "target in sight"

    def _drive(self, track: Track, tracks: Tracks, dt_s: float) -> tuple[float, float]:
        bearing_rad = track.bearing_rad
        if bearing_rad is None:
            bearing_rad = geometry.bearing_rad(track, tracks.width, self._fov_rad)
        distance_m = track.distance_m
        if distance_m is None:
            distance_m = geometry.distance_m(
                track, (tracks.width, tracks.height), self._fov_rad, self.settings.person_height_m
            )
        return self._controller.follow(distance_m, bearing_rad, dt_s)

    def _frame(self) -> FrameId | None:
        t = self._tracks
        if t is None:
            return None
        return FrameId(
            stream=t.stream, epoch=t.epoch, seq=t.seq, index=t.index, t_capture_ns=t.t_capture_ns
        )

    def _remember(
        self, state: FollowStateName, reason: str, tracks_age_s: float | None,
        linear_mps: float, angular_radps: float,
    ) -> None:  # fmt: skip
        self.state = FollowState(
            seq=self._seq, state=state, reason=reason, estop=self._estop, target=self._target,
            tracks_age_s=tracks_age_s, linear_mps=linear_mps, angular_radps=angular_radps,
        )  # fmt: skip


def _not_found(request: TargetRequest) -> str:
    if request.mode == "id":
        return f"nobody has id {request.track_id} now: see `heel status` for the ids in sight"
    return f"nobody at ({request.x_px:g}, {request.y_px:g}): click on a person's box"
