"""What services say of themselves, collected while a command listens."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from heel.schemas import (
    DriveState,
    EndOfStream,
    FollowState,
    Health,
    MessageError,
    Tracks,
    decode,
    keys,
)
from heel.services.commands.robot import Where
from heel.services.runtime.chain import Problem
from heel.services.runtime.logs import printable
from heel.services.runtime.robots import RobotWatch

if TYPE_CHECKING:
    from heel.services.runtime.inbox import Arrival

TOPICS = {"health": keys.ALL_HEALTH, "tracks": keys.ALL_TRACKS, "state": keys.FOLLOW_STATE,
          "drive": keys.ROBOT_DRIVE}  # fmt: skip
"""What is listened to, beside liveliness tokens."""
_MOST_UNREADABLE = 5
"""Unreadable messages that are told of; chosen by hand."""


@dataclass
class Observed(RobotWatch):
    """The services, the newest tracks and the follower's newest state."""

    tracks: Tracks | None = None
    unreadable: list[str] = field(default_factory=list)

    def take(self, arrival: Arrival) -> None:
        """A message came; one that cannot be read is noted."""
        try:
            self._take(arrival)
        except MessageError as error:
            self.note_unreadable(arrival.key, error)

    def take_state(self, state: FollowState, now_s: float) -> None:
        """The follower has told its state, or answered with it."""
        self.state, self.state_s = state, now_s

    def note_unreadable(self, key: str, error: Exception) -> None:
        """Remember the first few of what cannot be read."""
        if len(self.unreadable) < _MOST_UNREADABLE:
            self.unreadable.append(printable(f"{key}: {error}", 300))

    def _take(self, arrival: Arrival) -> None:
        import zenoh

        now_s = arrival.arrived_s
        if arrival.topic == "alive":
            _, service, instance = arrival.key.split("/")
            there = arrival.sample.kind == zenoh.SampleKind.PUT
            self.watch.token(service, instance, there, now_s)
        elif arrival.topic == "health":
            self.watch.hear(decode(Health, arrival.payload, arrival.encoding), now_s)
        elif arrival.topic == "state":
            self.take_state(decode(FollowState, arrival.payload, arrival.encoding), now_s)
        elif arrival.topic == "drive":
            self.drive = decode(DriveState, arrival.payload, arrival.encoding)
            self.drive_s = now_s
        elif arrival.encoding != EndOfStream.encoding():
            self.tracks = decode(Tracks, arrival.payload, arrival.encoding)

    def problems(self, where: Where, now_s: float) -> list[Problem]:
        """Problems of the services that are present, and the services that are missing."""
        # Of a run it is known that its parts did run.
        return self.lacks(where.expected, now_s, where.stack if where.run is None else ())

    def people(self, now_s: float) -> list[dict[str, Any]]:
        """People that can be chosen: the shown tracks; a distance where one is known."""
        tracks = () if self.tracks is None else self.tracks.tracks
        follower = self.state_now(now_s)
        target = None if follower is None else follower.target.track_id
        return [
            {
                "id": track.id,
                "state": track.state,
                "confidence": round(track.identity_confidence, 2),
                # The tracker's own, where it measures; of its target the follower's estimate.
                "distance_m": track.distance_m
                if follower is None or track.id != target
                else follower.distance_m,
            }
            for track in tracks if track.shown
        ]  # fmt: skip

    @property
    def versions(self) -> dict[str, str]:
        """Of the services, by `service/instance`."""
        return {
            f"{part.health.service}/{part.health.instance}": part.health.software_version
            for part in self.watch.parts.values()
        }


def sight(people: list[dict[str, Any]]) -> str:
    """Who is in sight, as one line."""
    told = []
    for one in people:
        far = "" if one["distance_m"] is None else f"{one['distance_m']:.1f} m, "
        told.append(f"{one['id']} ({far}{one['confidence']:.0%} sure)")
    return f"in sight: {', '.join(told) or 'nobody'}"


def facts(state: FollowState) -> str:
    """The follower's estimates of its target and of the free way, as one line."""
    known = []
    if state.distance_m is not None:
        known.append(f"{state.distance_m:.1f} m away")
    if state.identity_confidence is not None:
        next_best = state.runner_up_confidence
        beside = f" (next best {next_best:.0%})" if next_best is not None else ""
        known.append(f"{state.identity_confidence:.0%} sure{beside}")
    bounded = f" ({printable(state.speed_reason)})" if state.speed_reason else ""
    known.append(f"{state.linear_mps:.2f} m/s{bounded}")
    free = "" if state.free_distance_m is None else f", {state.free_distance_m:.1f} m free"
    watched = f"obstacles are watched{free}"
    known.append(watched if state.obstacle_watch else "nothing looks out for obstacles")
    return ", ".join(known)
