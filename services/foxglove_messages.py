"""What passes on the bus, as messages of Foxglove's own types: pictures with what is drawn on them,
poses, a log. Needs no bus and no clock: bytes in, bytes out.

Times are those of frames, so that marks lie on the very pictures that they belong to, and of
arrival for what is of no frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2

from heel.schemas import (
    DriveState,
    EStop,
    FollowState,
    Header,
    Health,
    HeelError,
    Message,
    MessageError,
    Odometry,
    TrackEvent,
    Tracks,
    decode,
)
from heel.schemas.image import JPEG, decode_image
from heel.services.drawing import Mark, Trails, marks

if TYPE_CHECKING:
    import foxglove.messages as types

LOG, POSE, TARGET = "/foxglove/log", "/foxglove/robot/pose", "/foxglove/follow/target"
_RAW_PERIOD_S = 0.2
"""Seconds between two raw pictures that are made a JPEG, which takes milliseconds of a core: enough
to see what went on. Chosen by hand."""
_QUALITY = 80
"""Of such a JPEG; chosen by hand."""
_FONT_PX = 14.0  # of labels on a picture; chosen by hand
_LINE_PX = 2.0  # of boxes, as films have them
_MOST_KNOWN = 64
"""Services and cameras whose last words are kept; bounds the memory, chosen by hand."""


def library() -> Any:
    """Foxglove's types.

    Raises:
        HeelError: the library is not installed.
    """
    try:
        import foxglove.messages
    except ImportError:
        raise HeelError(
            "Foxglove's types need a library: pip install foxglove-sdk; heel record does without "
            "(--no-foxglove)"
        ) from None
    return foxglove.messages


@dataclass(frozen=True, slots=True)
class Shown:
    """One message of Foxglove's.

    Attributes:
        topic: as Foxglove lists it.
        kind: class of `foxglove.messages`, with the schema.
        data: protobuf.
        logged_ns: when it counts.
    """

    topic: str
    kind: Any
    data: bytes
    logged_ns: int


class FoxgloveMessages:
    """Makes Foxglove's messages of those of the bus, one after the other.

    Raises:
        HeelError: the library is not installed.
    """

    def __init__(self) -> None:
        self._types = library()
        self._target_id: int | None = None
        self._trails: dict[str, Trails] = {}
        self._raw_s: dict[str, float] = {}
        self._said: dict[str, tuple[object, ...]] = {}
        takers: dict[type[Message], Callable[[Any, str, int], Iterator[Shown]]] = {
            Tracks: self._tracks, FollowState: self._follower, DriveState: self._drive,
            Odometry: self._odometry, TrackEvent: self._event, EStop: self._estop,
            Health: self._health,
        }  # fmt: skip
        self._takers = {kind.encoding(): (kind, taker) for kind, taker in takers.items()}

    def of(
        self, key: str, encoding: str, payload: bytes, attachment: bytes | None, logged_ns: int
    ) -> list[Shown]:
        """What a message is to Foxglove: nothing, one or several of its own.

        Args:
            key: that it was sent on.
            encoding: as its sender names it.
            payload, attachment: its bytes; what cannot be decoded is left out.
            logged_ns: when it came, wall clock.
        """
        try:
            if encoding.startswith("image/"):
                return list(self._picture(key, encoding, payload, attachment or b"", logged_ns))
            if (found := self._takers.get(encoding)) is None:
                return []
            kind, taker = found
            return list(taker(decode(kind, payload, encoding), key, logged_ns))
        except MessageError:
            # Who works with it says so.
            return []

    def _picture(
        self, key: str, encoding: str, payload: bytes, attachment: bytes, logged_ns: int
    ) -> Iterator[Shown]:
        header = decode(Header, attachment)
        if encoding != JPEG:
            since_s = logged_ns * 1e-9 - self._raw_s.get(key, -math.inf)
            if 0 <= since_s < _RAW_PERIOD_S or (len(self._raw_s) >= _MOST_KNOWN):
                return
            self._raw_s[key] = logged_ns * 1e-9
            image = decode_image(payload, header, encoding)
            _, made = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
            payload = made.tobytes()
        picture = self._types.CompressedImage(
            timestamp=self._time(header.t_capture_ns), frame_id=header.stream, data=payload,
            format="jpeg",
        )  # fmt: skip
        yield self._shown(f"/foxglove/cam/{header.stream}/image", picture, logged_ns)

    def _tracks(self, tracks: Tracks, key: str, logged_ns: int) -> Iterator[Shown]:
        if tracks.stream not in self._trails and len(self._trails) >= _MOST_KNOWN:
            return
        trails = self._trails.setdefault(tracks.stream, Trails())
        at = self._time(tracks.t_capture_ns)
        lines, texts = [], []
        for mark in marks(tracks, self._target_id):
            lines += self._lines(mark, trails.add(mark), at)
            texts.append(self._text(mark, at))
        drawn = self._types.ImageAnnotations(timestamp=at, points=lines, texts=texts)
        yield self._shown(f"/foxglove/cam/{tracks.stream}/people", drawn, logged_ns)

    def _lines(
        self, mark: Mark, trail: list[tuple[float, float]], at: types.Timestamp
    ) -> list[types.PointsAnnotation]:
        kinds = self._types.PointsAnnotationType
        left, top, right, bottom = mark.box
        corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
        # A box that is not measured is drawn open: Foxglove knows no dashes.
        kind = kinds.LineLoop if mark.measured else kinds.LineList
        drawn = [self._points(kind, corners, mark.rgb, at), self._points(kinds.LineStrip, trail,
                 mark.rgb, at)]  # fmt: skip
        if mark.is_target:
            around = [
                (x + (4 if x == right else -4), y + (4 if y == bottom else -4)) for x, y in corners
            ]
            drawn.append(self._points(kinds.LineLoop, around, (1.0, 1.0, 1.0), at))
        return drawn

    def _points(
        self, kind: Any, points: list[tuple[float, float]], rgb: tuple[float, float, float],
        at: types.Timestamp,
    ) -> types.PointsAnnotation:  # fmt: skip
        made: types.PointsAnnotation = self._types.PointsAnnotation(
            timestamp=at, type=kind, thickness=_LINE_PX, outline_color=self._colour(rgb),
            points=[self._types.Point2(x=x, y=y) for x, y in points],
        )  # fmt: skip
        return made

    def _text(self, mark: Mark, at: types.Timestamp) -> types.TextAnnotation:
        left, top, _, _ = mark.box
        made: types.TextAnnotation = self._types.TextAnnotation(
            timestamp=at, text=mark.label, font_size=_FONT_PX,
            position=self._types.Point2(x=left, y=max(_FONT_PX, top - 4)),
            text_color=self._colour(mark.rgb), background_color=self._colour((0.0, 0.0, 0.0), 0.6),
        )  # fmt: skip
        return made

    def _follower(self, state: FollowState, key: str, logged_ns: int) -> Iterator[Shown]:
        self._target_id = state.target.track_id
        level = "Warning" if state.state in ("unsure", "lost", "stopped") else "Info"
        words = f"{state.state}: {state.reason}"
        yield from self._log("follower", level, words, logged_ns, (state.state, state.reason))
        if state.distance_m is not None and state.bearing_rad is not None:
            x = state.distance_m * math.cos(state.bearing_rad)
            y = state.distance_m * math.sin(state.bearing_rad)
            yield self._pose(TARGET, "robot", x, y, 0.0, logged_ns)

    def _drive(self, drive: DriveState, key: str, logged_ns: int) -> Iterator[Shown]:
        # What it was told is the follower's word already.
        reason = "" if drive.state == "driving" else drive.reason
        level = "Info" if drive.state == "driving" else "Warning"
        words = f"{drive.state}: {reason}" if reason else drive.state
        yield from self._log("drive", level, words, logged_ns, (drive.state, reason))

    def _odometry(self, odometry: Odometry, key: str, logged_ns: int) -> Iterator[Shown]:
        place = odometry.x_m, odometry.y_m, odometry.heading_rad
        yield self._pose(POSE, "odom", *place, logged_ns)

    def _event(self, event: TrackEvent, key: str, logged_ns: int) -> Iterator[Shown]:
        yield from self._log("tracker", "Info", event.text, logged_ns, None)

    def _estop(self, stop: EStop, key: str, logged_ns: int) -> Iterator[Shown]:
        word = "pressed" if stop.engaged else "released"
        words = f"emergency stop {word} by {stop.source}"
        yield from self._log("estop", "Error", words, logged_ns, (stop.engaged, stop.id))

    def _health(self, health: Health, key: str, logged_ns: int) -> Iterator[Shown]:
        name = f"{health.service}/{health.instance}"
        levels = {"error": "Error", "degraded": "Warning"}
        words = f"{health.state}: {health.reason}" if health.reason else health.state
        said = health.state, health.reason
        yield from self._log(name, levels.get(health.state, "Info"), words, logged_ns, said)

    def _log(
        self, name: str, level: str, words: str, logged_ns: int, said: tuple[object, ...] | None
    ) -> Iterator[Shown]:
        """A line of the log; the same words of the same speaker are told once."""
        if said is not None:
            if self._said.get(name) == said:
                return
            if name in self._said or len(self._said) < _MOST_KNOWN:
                self._said[name] = said
        line = self._types.Log(
            timestamp=self._time(logged_ns), level=getattr(self._types.LogLevel, level),
            message=words, name=name,
        )  # fmt: skip
        yield self._shown(LOG, line, logged_ns)

    def _pose(
        self, topic: str, frame: str, x_m: float, y_m: float, heading_rad: float, logged_ns: int
    ) -> Shown:
        t = self._types
        turned = t.Quaternion(z=math.sin(heading_rad / 2), w=math.cos(heading_rad / 2))
        pose = t.Pose(position=t.Vector3(x=x_m, y=y_m), orientation=turned)
        made = t.PoseInFrame(timestamp=self._time(logged_ns), frame_id=frame, pose=pose)
        return self._shown(topic, made, logged_ns)

    def _shown(self, topic: str, message: Any, logged_ns: int) -> Shown:
        return Shown(topic, type(message), message.encode(), logged_ns)

    def _time(self, t_ns: int) -> types.Timestamp:
        seconds, rest = divmod(t_ns, 10**9)
        made: types.Timestamp = self._types.Timestamp(sec=min(seconds, 2**32 - 1), nsec=rest)
        return made

    def _colour(self, rgb: tuple[float, float, float], alpha: float = 1.0) -> types.Color:
        made: types.Color = self._types.Color(r=rgb[0], g=rgb[1], b=rgb[2], a=alpha)
        return made
