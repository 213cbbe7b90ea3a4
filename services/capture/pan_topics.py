"""The topics that turn a virtual pan, to its steering."""

from __future__ import annotations

from heel.schemas import (
    DriveState,
    EndOfStream,
    FollowState,
    MessageError,
    SettingsError,
    Tracks,
    decode,
    keys,
)
from heel.services.capture.pan_window import PanWindow
from heel.services.capture.settings import CaptureSettings
from heel.services.capture.steering import Steering
from heel.services.runtime import qos
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.service import ServiceContext

LISTEN_S = 0.01
"""Between two looks at the topics: the drive speaks every 0.02 s."""
_ODOMETRY_S = 0.02
"""Seconds between two messages of odometry: 50 a second, as a robot sends."""
_TOPICS = ("drive", "state", "tracks")


class PanTopics:
    """Hears drive, target and tracks in the capture process, and tells how the window turned.

    Args:
        context: of the capture service.
        window: of its source.

    Raises:
        SettingsError: the run is lossless; what the robot does to a picture needs a clock.
    """

    def __init__(self, context: ServiceContext[CaptureSettings], window: PanWindow) -> None:
        if context.settings.delivery == "lossless":
            raise SettingsError(
                f"{context.settings.source}: a virtual pan turns in real time and cannot be "
                "lossless: use --delivery live"
            )
        self._context = context
        self._steering = Steering(window)
        self._odometry = context.publisher(keys.ROBOT_ODOMETRY, qos.ODOMETRY)
        self._seq, self._due_s = 0, 0.0
        context.inbox.subscribe("drive", keys.ROBOT_DRIVE, qos.DRIVE)
        context.inbox.subscribe("state", keys.FOLLOW_STATE, qos.STATE)
        context.inbox.subscribe("tracks", keys.tracks(context.settings.camera), qos.TRACKS)

    def turn(self, now_s: float) -> None:
        """Take what has arrived and turn the window on to `now_s`, without waiting."""
        while (arrival := self._context.inbox.get(0.0, *_TOPICS)) is not None:
            if arrival.encoding != EndOfStream.encoding():
                self._hear(arrival)
        self._steering.advance(now_s)
        if now_s >= self._due_s:
            self._odometry.send(self._steering.odometry(self._seq), 0.0)
            self._seq, self._due_s = self._seq + 1, now_s + _ODOMETRY_S

    def _hear(self, arrival: Arrival) -> None:
        try:
            if arrival.topic == "drive":
                told = decode(DriveState, arrival.payload, arrival.encoding)
                self._steering.hear_drive(told.angular_radps, arrival.arrived_s)
            elif arrival.topic == "state":
                state = decode(FollowState, arrival.payload, arrival.encoding)
                self._steering.hear_target(state.target.track_id)
            else:
                self._steering.hear_tracks(decode(Tracks, arrival.payload, arrival.encoding))
        except MessageError as error:
            self._context.statistics.malformed += 1
            self._context.warn.warning(arrival.topic, f"{arrival.key}: {error}", arrival.arrived_s)
