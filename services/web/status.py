"""Everything the page shows beside the picture, as one JSON object. Owned by the service loop."""

from __future__ import annotations

from typing import Any

from schemas import DriveState, EndOfStream, FollowState, Header, Health, MotionCommand

MAX_SERVICES = 32
NOTICE = "notice"
"""The detail of a service's health that the page shows as it is."""
_NOTICE_LENGTH = 200
_SILENT_AFTER_S = 5.0
_FORGET_AFTER_S = 60.0


class StatusBoard:
    """Collects the last word of every service and puts ages to it.

    Args:
        camera: whose stream is shown.
        stale_after_s: age at which the page is to warn.
    """

    def __init__(self, camera: str, stale_after_s: float) -> None:
        self._camera = camera
        self._stale_after_s = stale_after_s
        self._picture: tuple[Header, float] | None = None
        self._tracks_s: float | None = None
        self._ended: EndOfStream | None = None
        self._command: tuple[MotionCommand, float] | None = None
        self._drive: tuple[DriveState, float] | None = None
        self._services: dict[tuple[str, str], tuple[Health, float]] = {}
        self.follower: FollowState | None = None
        """The follower's last word."""

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

    def command(self, command: MotionCommand, now_s: float) -> None:
        """A motion command went by."""
        self._command = (command, now_s)

    def drive(self, state: DriveState, now_s: float) -> None:
        """The wheels were told something."""
        self._drive = (state, now_s)

    def health(self, health: Health, now_s: float) -> None:
        """A service spoke of itself."""
        known = (health.service, health.instance)
        if known not in self._services and len(self._services) >= MAX_SERVICES:
            oldest = min(self._services, key=lambda name: self._services[name][1])
            del self._services[oldest]
        self._services[known] = (health, now_s)

    def compose(self, now_s: float) -> dict[str, Any]:
        """The status of this moment; times are monotonic seconds."""
        self._services = {
            name: entry
            for name, entry in self._services.items()
            if now_s - entry[1] < _FORGET_AFTER_S
        }
        return {
            "type": "status",
            "camera": self._camera,
            "picture": self._compose_picture(now_s),
            "follower": self._compose_follower(),
            "command": self._compose_command(now_s),
            "drive": self._compose_drive(now_s),
            "notices": self._notices(now_s),
            "services": [
                _compose_service(health, now_s - heard_s)
                for _, (health, heard_s) in sorted(self._services.items())
            ],
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
        return {
            "state": state.state,
            "reason": state.reason,
            "estop": state.estop,
            "target": state.target.model_dump(
                include={"mode", "track_id", "tracker", "reason"}
            ),
        }  # fmt: skip

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
            "driver": state.driver,
            "linear_mps": round(state.linear_mps, 4),
            "angular_radps": round(state.angular_radps, 4),
            "age_s": round(now_s - heard_s, 3),
        }

    def _notices(self, now_s: float) -> list[str]:
        """What services want to have said to whoever looks, while they live."""
        return [
            health.details[NOTICE][:_NOTICE_LENGTH]
            for health, heard_s in self._services.values()
            if NOTICE in health.details and health.state != "ended"
            and now_s - heard_s < _SILENT_AFTER_S
        ]  # fmt: skip


def _compose_service(health: Health, silent_s: float) -> dict[str, Any]:
    shown = health.model_dump(
        include={"service", "instance", "state", "reason", "dropped", "malformed"}
    )
    numbers = ("rate_in_hz", "rate_out_hz", "age_ms_p50", "age_ms_p95", "busy_ms_p50", "rss_mb")
    return shown | {"silent_s": round(silent_s, 2)} | {
        name: round(getattr(health, name), 1) for name in numbers
    }  # fmt: skip
