"""The facts of a recording of the bus, also of one that was cut off."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from heel.schemas import (
    Blobs,
    CameraInfo,
    DriveState,
    EStop,
    FollowState,
    Header,
    Health,
    Message,
    MessageError,
    MotionCommand,
    Odometry,
    SimTruth,
    SimWorld,
    Stamp,
    TrackEvent,
    Tracks,
    decode,
)
from heel.schemas.image import JPEG, RAW
from heel.services.commands.report.facts import (
    Curve,
    Event,
    Facts,
    Sighting,
    Spans,
    alike,
    doubts_of,
)
from heel.services.recordings.reading import Recording, wire_messages
from heel.services.recordings.wire import WireMessage
from heel.services.run.following import FollowingTally
from heel.services.run.onlooker import Onlooker
from heel.services.run.outputs import track_rows

_SETTINGS = "heel.settings."
"""How the metadata records begin that hold the settings of a service."""
_HOPS = ("camera", "detector", "tracker", "follower", "wheels")


def read_recording(path: Path) -> tuple[Facts, list[str]]:
    """What a recording tells.

    Returns:
        The facts, and the rows of its tracks as `tracks.txt` has them, for scores.

    Raises:
        SourceError: it cannot be read, or is no recording.
    """
    recording = Recording(path)
    reader = _Reader(path.name)
    for message in wire_messages(recording):
        reader.take(message)
    return reader.finish(recording), reader.rows


class _Reader:
    """Takes the messages of a recording one by one."""

    def __init__(self, name: str) -> None:
        self.facts = Facts(name, "recording")
        self.rows: list[str] = []
        self._first_ns: int | None = None
        self._t_s = 0.0
        self._undecodable = 0
        self._states, self._wheels = Spans(), Spans()
        self._commanded = Curve("commanded"), Curve("commanded")
        self._driven = Curve("wheels"), Curve("wheels")
        self._moved = Curve("odometry"), Curve("odometry")
        self._target, self._nearest = Curve("target"), Curve("nearest person")
        self._truly = Curve("nearest, by the simulated world")
        self._sure, self._other = Curve("target"), Curve("best other person")
        self._ages = {hop: Curve(hop) for hop in _HOPS}
        self._acted: tuple[int, int] | None = None
        self._state: FollowState | None = None
        self._engaged: str | None = None
        self._infos: dict[str, CameraInfo] = {}
        self._health: dict[str, Health] = {}
        self._pictures: set[str] = set()
        self._tally = FollowingTally()
        self._world = Onlooker(self._tally, lambda request: None)
        kinds: dict[type[Message], Callable[[Any, WireMessage], None]] = {
            Blobs: self._blobs, Tracks: self._tracks, MotionCommand: self._command,
            FollowState: self._follow, DriveState: self._drive, Odometry: self._odometry,
            TrackEvent: self._event, EStop: self._estop, SimTruth: self._truth,
            SimWorld: self._episode, CameraInfo: self._info, Health: self._healthy,
        }  # fmt: skip
        self._takers = {kind.encoding(): (kind, taker) for kind, taker in kinds.items()}

    def take(self, message: WireMessage) -> None:
        """Take one message; what cannot be decoded is counted."""
        if self._first_ns is None:
            self._first_ns = message.logged_ns
        self._t_s = max(self._t_s, (message.logged_ns - self._first_ns) * 1e-9)
        try:
            if message.encoding in (JPEG, RAW):
                self._image(message)
            elif (found := self._takers.get(message.encoding)) is not None:
                kind, taker = found
                taker(decode(kind, message.payload, message.encoding), message)
        except MessageError:
            self._undecodable += 1

    def finish(self, recording: Recording) -> Facts:
        """Everything, once the file is read to its end."""
        facts = self.facts
        facts.duration_s = self._t_s
        facts.states = self._states.end(self._t_s)
        facts.wheels = self._wheels.end(self._t_s)
        pairs = (self._commanded, self._driven, self._moved)
        facts.linear = [linear for linear, _ in pairs if linear.values]
        facts.angular = [angular for _, angular in pairs if angular.values]
        facts.distances = _with_values(self._target, self._nearest, self._truly)
        facts.confidences = _with_values(self._sure, self._other)
        facts.ages = _with_values(*self._ages.values())
        facts.events = sorted(facts.events + doubts_of(facts.states), key=lambda one: one.t_s)
        facts.settings = _settings(recording)
        facts.health = [(name, _words(one)) for name, one in sorted(self._health.items())]
        self._about(recording)
        self._figures()
        self._notes(recording)
        return facts

    def _image(self, message: WireMessage) -> None:
        header = decode(Header, message.attachment or b"")
        self._pictures.add(message.key)
        self._ages["camera"].add(self._t_s, header.age_ns * 1e-6)

    def _blobs(self, blobs: Blobs, message: WireMessage) -> None:
        self._age("detector", message)

    def _tracks(self, tracks: Tracks, message: WireMessage) -> None:
        stamp = self._age("tracker", message)
        self.rows += track_rows(tracks)
        self._world.tracks(tracks)
        state = self._state
        if state is None or stamp is None or state.target.track_id is None:
            return
        if state.target.tracker not in (None, stamp.origin, stamp.producer):
            return
        for track in tracks.tracks:
            if track.id == state.target.track_id and track.shown:
                self.facts.sightings.append(
                    Sighting(
                        self._t_s, (tracks.epoch, tracks.seq), track.id, track.box_xyxy,
                        (tracks.width, tracks.height), state.state,
                    )
                )  # fmt: skip

    def _command(self, command: MotionCommand, message: WireMessage) -> None:
        self._commanded[0].add(self._t_s, command.linear_mps)
        self._commanded[1].add(self._t_s, command.angular_radps)
        by_hand = command.manual and command.state == "idle"
        self._states.take(self._t_s, "by hand" if by_hand else command.state, command.reason)
        frame = None if command.frame is None else (command.frame.epoch, command.frame.seq)
        if frame is not None and frame != self._acted:
            # The age that counts is that of the first command that rests on a frame.
            self._acted = frame
            self._age("follower", message)

    def _follow(self, state: FollowState, message: WireMessage) -> None:
        self._state = state
        self._world.state(state)
        self._target.add(self._t_s, state.distance_m)
        self._nearest.add(self._t_s, state.nearest_person_m)
        self._sure.add(self._t_s, state.identity_confidence)
        self._other.add(self._t_s, state.runner_up_confidence)

    def _drive(self, drive: DriveState, message: WireMessage) -> None:
        self._driven[0].add(self._t_s, drive.linear_mps)
        self._driven[1].add(self._t_s, drive.angular_radps)
        name, reason = drive.state, drive.reason
        self._wheels.take(self._t_s, name, "" if name == "driving" else reason)
        if name == "driving":
            self._age("wheels", message)

    def _odometry(self, odometry: Odometry, message: WireMessage) -> None:
        self._moved[0].add(self._t_s, odometry.linear_mps)
        self._moved[1].add(self._t_s, odometry.angular_radps)

    def _event(self, event: TrackEvent, message: WireMessage) -> None:
        self.facts.events.append(
            Event(self._t_s, "tracker", event.kind, event.text, event.ids, event.frame.index + 1)
        )

    def _estop(self, stop: EStop, message: WireMessage) -> None:
        engagement = stop.id if stop.engaged else None
        if engagement == self._engaged:
            return
        self._engaged = engagement
        word = "pressed" if stop.engaged else "released"
        text = f"emergency stop {word} by {stop.source or 'somebody'}"
        self.facts.events.append(Event(self._t_s, "stop", f"stop {word}", text))

    def _truth(self, truth: SimTruth, message: WireMessage) -> None:
        self._world.truth(truth)
        robot = truth.robot
        self._truly.add(self._t_s, min(
            (math.hypot(one.pose.x_m - robot.x_m, one.pose.y_m - robot.y_m)
             for one in truth.people), default=None,
        ))  # fmt: skip

    def _episode(self, world: SimWorld, message: WireMessage) -> None:
        self._world.episode()
        self.facts.about.append(("simulated world", f"{world.scenario}, seed {world.seed}"))

    def _info(self, info: CameraInfo, message: WireMessage) -> None:
        self._infos[info.stream] = info

    def _healthy(self, health: Health, message: WireMessage) -> None:
        before = self._health.get(key := f"{health.service}/{health.instance}")
        self._health[key] = health
        same = before is not None and before.state == health.state
        if before is not None and same and alike(before.reason, health.reason):
            return
        if health.state in ("degraded", "error") or (before is not None and health.state == "ok"):
            text = f"{key} is {health.state}{f': {health.reason}' if health.reason else ''}"
            self.facts.events.append(Event(self._t_s, "health", health.state, text))

    def _age(self, hop: str, message: WireMessage) -> Stamp | None:
        if message.attachment is None:
            return None
        stamp = decode(Stamp, message.attachment)
        self._ages[hop].add(self._t_s, stamp.age_ns * 1e-6)
        return stamp

    def _about(self, recording: Recording) -> None:
        about = self.facts.about
        about.append(("recorded by", recording.library or "an unknown writer"))
        for name, info in sorted(self._infos.items()):
            size = f"{info.width}x{info.height} at {info.fps:g} frames/s"
            about.append((f"camera {name}", f"{size}: {info.source}"))
        detector, tracker = (self.facts.settings.get(name, {}) for name in ("detector", "tracker"))
        if "detector" in detector:
            about.append(("detector", str(detector["detector"])))
        if "preset" in tracker:
            about.append(("tracker", f"preset {tracker['preset']}"))
        versions = {one.software_version for one in self._health.values()}
        if versions:
            about.append(("software", "heel-follow " + ", ".join(sorted(versions))))

    def _figures(self) -> None:
        figures = self._tally.figures
        if not figures.time_s:
            return
        gap = "-" if figures.least_gap_m is None else f"{figures.least_gap_m:.2f} m"
        self.facts.scored_by = "the simulated world's own truth"
        self.facts.scores = [
            ("acted upon the right person", f"{figures.followed_s / figures.time_s:.1%}"),
            ("acted upon another", f"{figures.wrong_s:.1f} s"),
            ("contacts", str(figures.contacts)),
            ("least gap to anybody", gap),
            ("driven", f"{figures.driven_m:.1f} m"),
        ]

    def _notes(self, recording: Recording) -> None:
        notes = self.facts.notes
        if self._first_ns is None:
            notes.append("there is no message of Heel's in it")
        if not recording.complete:
            why = recording.damage or "without an index"
            notes.append(f"the file is cut off ({why}): its recorder was ended by force")
        if self._undecodable:
            notes.append(f"{self._undecodable} messages cannot be decoded, and are left out")
        if self._first_ns is not None and not self._pictures:
            notes.append("no pictures in it: record with --frames jpeg or --frames raw")


def _with_values(*curves: Curve) -> list[Curve]:
    return [curve for curve in curves if curve.known.size]


def _settings(recording: Recording) -> dict[str, Any]:
    """Settings in force by service, as the recorder has asked for them."""
    found: dict[str, Any] = {}
    for name, fields in recording.metadata.items():
        if not name.startswith(_SETTINGS):
            continue
        for text in fields.values():
            try:
                table = json.loads(text)
            except (ValueError, RecursionError):
                continue
            if isinstance(table, dict):
                found |= {key: one for key, one in table.items() if isinstance(one, dict)}
    return found


def _words(health: Health) -> str:
    reason = f" ({health.reason})" if health.reason else ""
    return (
        f"{health.state}{reason}, {health.dropped} frames dropped, {health.malformed} messages "
        f"refused, busy {health.busy_ms_p95:.1f} ms of a message at p95, "
        f"{health.peak_rss_mb:.0f} MB at most"
    )
