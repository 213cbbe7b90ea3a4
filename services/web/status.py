"""Everything the page shows beside the picture, as one JSON object. Owned by the service loop."""

from __future__ import annotations

from collections import deque
from typing import Any, Literal

from heel.schemas import (
    DriveState,
    EndOfStream,
    FollowState,
    Header,
    Health,
    MotionCommand,
    TrackEvent,
)
from heel.services.runtime.chain import MISSING, ChainWatch, Part, Problem
from heel.services.runtime.logs import printable

NOTICE = "notice"
"""The detail of a service's health that the page shows, marked as that service's."""
_NOTICE_LENGTH = 200
"""Characters of a notice that the page shows; chosen by hand."""
_MAX_NOTICES = 3
"""Notices that the page shows at once; chosen by hand."""
_KEPT_EVENTS = 64
"""Events of all identities that are kept, for a target that is chosen later; chosen by hand."""
_TOLD_EVENTS = 4
"""Sentences about the target that the page shows, the newest first; chosen by hand."""
_FOLLOWER_SILENT_S = 1.0
"""Seconds that a word of the follower counts as a confirmation; it says five a second."""
_DRIVE_SILENT_S = 0.5
"""Seconds that a word of the drive counts; it says 50 a second."""
_FORGET_AFTER_S = 60.0
"""Seconds after which a part that is gone is not shown any more; chosen by hand."""
_SETTLED_S = 3.0
"""How long after its start the page may still be hearing of parts for the first time."""


class StatusBoard:
    """Collects the last word of every service and puts ages to it.

    Args:
        camera: name of the camera that is shown.
        stale_after_s: age at which the page is to warn.
        own: producer name of the web service itself.
    """

    def __init__(self, camera: str, stale_after_s: float, own: str = "") -> None:
        self._camera = camera
        self._stale_after_s = stale_after_s
        self._picture: tuple[Header, float] | None = None
        self._tracks_s: float | None = None
        self._ended: EndOfStream | None = None
        self._command: tuple[MotionCommand, float] | None = None
        self._drive: tuple[DriveState, float] | None = None
        self._events: deque[tuple[TrackEvent, str, float]] = deque(maxlen=_KEPT_EVENTS)
        self._unconfirmed_s: float | None = None
        self._started_s: float | None = None
        self.watch = ChainWatch(own)
        """The parts that are there."""
        self.follower: FollowState | None = None
        """The follower's last word."""
        self._follower_s = float("-inf")

    def image(self, header: Header, now_s: float) -> None:
        """A picture arrived; if it is of another epoch the stream has begun anew."""
        self._picture = (header, now_s)
        if self._ended is not None and self._ended.epoch != header.epoch:
            self._ended = None

    def tracks(self, now_s: float) -> None:
        """Tracks arrived."""
        self._tracks_s = now_s

    def end(self, end: EndOfStream) -> None:
        """The camera's stream has ended."""
        self._ended = end

    @property
    def has_ended(self) -> bool:
        """Whether the stream shown has ended."""
        return self._ended is not None

    def follow(self, state: FollowState, now_s: float) -> None:
        """The follower told its state."""
        self.follower, self._follower_s = state, now_s

    def command(self, command: MotionCommand, now_s: float) -> None:
        """A motion command went by."""
        self._command = (command, now_s)

    def drive(self, state: DriveState, now_s: float) -> None:
        """The wheels were told something."""
        self._drive = (state, now_s)

    def event(self, event: TrackEvent, tracker: str, now_s: float) -> None:
        """A tracker found out something about an identity."""
        self._events.append((event, tracker, now_s))

    def health(self, health: Health, now_s: float) -> None:
        """A service spoke of itself."""
        self.watch.hear(health, now_s)

    def problems(self, now_s: float) -> list[Problem]:
        """Parts that are gone, silent or there twice; what ends with its stream is not missed."""
        if self._started_s is None:
            self._started_s = now_s
        found = self.watch.problems(now_s)
        if now_s - self._started_s > _SETTLED_S:
            reported: set[str] = set()
            for part, state in self.watch.rows(now_s):
                if state == "ok" and part.health.details.get(MISSING):
                    reported |= set(part.health.details[MISSING].split(","))
            found += self.watch.missing(reported, now_s)
        return [] if self.has_ended else found

    def stop(self, engaged: bool, now_s: float) -> dict[str, Any]:
        """What became of an emergency stop: which parts have confirmed it, and how long none has.

        The drive's word counts wherever a drive was ever heard; the follower's where none was.
        """
        confirmed = self._confirmed_by(now_s) if engaged else None
        if not engaged or confirmed is not None:
            self._unconfirmed_s = None
        elif self._unconfirmed_s is None:
            self._unconfirmed_s = now_s
        waiting_s = None if self._unconfirmed_s is None else now_s - self._unconfirmed_s
        return {
            "confirmed_by": confirmed,
            "unconfirmed_s": None if waiting_s is None else round(waiting_s, 2),
        }

    def _confirmed_by(self, now_s: float) -> Literal["drive", "follower"] | None:
        if self._drive is not None:
            state, heard_s = self._drive
            return "drive" if state.estop and now_s - heard_s < _DRIVE_SILENT_S else None
        fresh = now_s - self._follower_s < _FOLLOWER_SILENT_S
        stands = self.follower is not None and self.follower.estop
        return "follower" if stands and fresh else None

    def compose(self, now_s: float) -> dict[str, Any]:
        """The status of this moment; times are monotonic seconds."""
        bus_silent_s = self.watch.bus_silent_s(now_s)
        return {
            "type": "status",
            "camera": self._camera,
            "picture": self._compose_picture(now_s),
            "follower": self._compose_follower(),
            "story": self._compose_story(now_s),
            "command": self._compose_command(now_s),
            "drive": self._compose_drive(now_s),
            "bus_silent_s": None if bus_silent_s is None else round(bus_silent_s, 1),
            "notices": self._notices(now_s),
            "services": [
                _compose_service(part, state, now_s - part.heard_s)
                for part, state in self.watch.rows(now_s)
                if now_s - part.heard_s < _FORGET_AFTER_S
            ],
            "unlisted": self.watch.unlisted,
        }

    def _compose_picture(self, now_s: float) -> dict[str, Any]:
        ended = self._ended
        return {
            "age_s": None if self._picture is None else round(now_s - self._picture[1], 3),
            "tracks_age_s": None if self._tracks_s is None else round(now_s - self._tracks_s, 3),
            "stale_after_s": self._stale_after_s,
            "ended": None if ended is None else {"frames": ended.frames, "reason": ended.reason},
        }

    def _compose_follower(self) -> dict[str, Any] | None:
        state = self.follower
        if state is None:
            return None
        passed_on = {
            "state", "reason", "estop", "distance_m", "bearing_rad", "identity_confidence",
            "runner_up_confidence", "speed_reason", "obstacle_watch", "free_distance_m",
            "pending_point_px", "pending_for_s", "tracks_age_s", "driven_by",
        }  # fmt: skip
        target = state.target.model_dump(include={"seq", "mode", "track_id", "tracker", "reason"})
        return state.model_dump(mode="json", include=passed_on) | {"target": target}

    def _compose_story(self, now_s: float) -> list[dict[str, Any]]:
        """What became of the target's identity, the newest first."""
        target = None if self.follower is None else self.follower.target
        if target is None or target.track_id is None:
            return []
        own = [
            {"text": printable(event.text, 300), "age_s": round(now_s - heard_s, 1)}
            for event, tracker, heard_s in self._events
            if target.track_id in event.ids and tracker == target.tracker
        ]
        return own[: -_TOLD_EVENTS - 1 : -1]

    def _compose_command(self, now_s: float) -> dict[str, Any] | None:
        if self._command is None:
            return None
        command, heard_s = self._command
        return {
            "linear_mps": round(command.linear_mps, 4),
            "angular_radps": round(command.angular_radps, 4),
            "age_s": round(now_s - heard_s, 3),
            "ttl_s": command.ttl_s,
        }

    def _compose_drive(self, now_s: float) -> dict[str, Any] | None:
        if self._drive is None:
            return None
        state, heard_s = self._drive
        return {
            "state": state.state,
            "reason": state.reason,
            "estop": state.estop,
            "driver": state.driver,
            "linear_mps": round(state.linear_mps, 4),
            "angular_radps": round(state.angular_radps, 4),
            "age_s": round(now_s - heard_s, 3),
        }

    def _notices(self, now_s: float) -> list[dict[str, str]]:
        """What services want to have said on the page, while they live."""
        told = [
            {"service": part.health.service,
             "text": printable(part.health.details[NOTICE], _NOTICE_LENGTH)}
            for part, state in self.watch.rows(now_s)
            if state == "ok" and part.health.details.get(NOTICE)
        ]  # fmt: skip
        return told[:_MAX_NOTICES]


def _compose_service(part: Part, state: str, silent_s: float) -> dict[str, Any]:
    health = part.health
    shown = health.model_dump(
        include={"service", "instance", "producer", "state", "reason", "dropped", "malformed"}
    )
    numbers = ("rate_in_hz", "rate_out_hz", "age_ms_p50", "age_ms_p95", "busy_ms_p50", "rss_mb")
    return shown | {"heard": state, "silent_s": round(silent_s, 2)} | {
        name: round(getattr(health, name), 1) for name in numbers
    }  # fmt: skip
