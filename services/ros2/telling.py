"""What the robot's ROS is told of the run: the people in sight, and every part's health."""

from __future__ import annotations

from collections import deque
from typing import Any

from heel.schemas import CameraInfo, FollowState, Health, MessageError, Tracks, decode, keys
from heel.services.ros2.convert import people_of, status_of
from heel.services.ros2.node import RosNode
from heel.services.ros2.settings import Ros2Settings
from heel.services.runtime import qos
from heel.services.runtime.chain import MAX_PARTS
from heel.services.runtime.latched import LatchedQuery
from heel.services.runtime.service import ServiceContext

_DIAGNOSTICS_S = 1.0
"""Seconds between two arrays of diagnostics: what ROS's aggregator expects."""
_FORGOTTEN_S = 30.0
"""Seconds after which a part that is silent is told of no more; chosen by hand."""
_PICTURES = 64
"""Pictures whose ROS header is remembered for their tracks: three seconds at 20 a second."""


class Telling:
    """Listens to what is to be told, where a topic is named for it."""

    def __init__(self, context: ServiceContext[Ros2Settings], node: RosNode) -> None:
        s = context.settings
        self._context, self._node = context, node
        self._people = bool(s.people_topic or s.detections_topic)
        self._diagnostics = bool(s.diagnostics_topic)
        if self._people:
            self._tracks = context.subscribe(
                "tracks", keys.tracks(s.camera), qos.TRACKS, primary=False
            )
            self._info_asked = LatchedQuery(context.session, keys.info(s.camera), CameraInfo)
        if self._diagnostics:
            context.inbox.subscribe("health", keys.ALL_HEALTH, qos.HEALTH)
        self._info: CameraInfo | None = None
        self._headers: deque[tuple[int, int, Any]] = deque(maxlen=_PICTURES)
        self._parts: dict[tuple[str, str], tuple[Health, float]] = {}
        self._due_s = 0.0

    def picture(self, epoch: int, seq: int, header: Any) -> None:
        """Remember the ROS header of a picture that was passed on."""
        self._headers.append((epoch, seq, header))

    def tell(self, now_s: float, state: FollowState | None) -> None:
        """Pass on what is new.

        Args:
            now_s: monotonic time.
            state: of the follower, None before the first.
        """
        if self._people:
            self._tell_people(now_s, None if state is None else state.target.track_id)
        if self._diagnostics:
            self._tell_health(now_s)

    def _tell_people(self, now_s: float, chosen_id: int | None) -> None:
        arrival = self._context.inbox.latest("tracks")
        received = None if arrival is None else self._tracks.message(arrival, Tracks)
        if received is None:
            return
        tracks = received.message
        if self._info is None or self._info.epoch != tracks.epoch:
            try:
                self._info = self._info_asked.poll(now_s) or self._info
            except MessageError as error:
                self._context.warn.warning("info", f"{error}", now_s)
        same = self._info is not None and self._info.epoch == tracks.epoch
        header = next(
            (header for epoch, seq, header in self._headers
             if (epoch, seq) == (tracks.epoch, tracks.seq)), None,
        )  # fmt: skip
        self._node.send_people(people_of(tracks, self._info if same else None, chosen_id), header)

    def _tell_health(self, now_s: float) -> None:
        while (arrival := self._context.inbox.get(0, "health")) is not None:
            try:
                health = decode(Health, arrival.payload, arrival.encoding)
            except MessageError as error:
                self._context.warn.warning("health", f"{arrival.key}: {error}", now_s)
                continue
            key = health.service, health.instance
            if key in self._parts or len(self._parts) < MAX_PARTS:
                self._parts[key] = health, arrival.arrived_s
        if now_s < self._due_s:
            return
        self._due_s = now_s + _DIAGNOSTICS_S
        self._parts = {
            key: part for key, part in self._parts.items() if now_s - part[1] <= _FORGOTTEN_S
        }
        parts = [status_of(health, now_s - heard_s) for health, heard_s in self._parts.values()]
        self._node.send_diagnostics(parts, self._context.robot)
