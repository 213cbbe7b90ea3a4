"""What the follower receives of each of several cameras."""

from __future__ import annotations

from dataclasses import dataclass, replace

from heel.schemas import CameraInfo, EndOfStream, Taken, Tracks, decode, keys
from heel.services.follower.camera_info import CameraInfos
from heel.services.follower.frame_times import FrameTimes
from heel.services.follower.settings import FollowerServiceSettings
from heel.services.runtime import qos
from heel.services.runtime.clock import monotonic_clock
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.latched import LatchedQuery
from heel.services.runtime.service import ServiceContext
from heel.services.runtime.streams import Received, StreamJudge

_OF_CAMERAS = ("tracks", "taken", "info")


@dataclass
class Eye:
    """One camera: which messages are believed, how old they are, how it is mounted."""

    camera: str
    tracks: StreamJudge
    taken: StreamJudge | None
    times: FrameTimes
    infos: CameraInfos
    info_asked: LatchedQuery[CameraInfo]
    info_epoch: int | None = None
    newest: Received[Tracks] | None = None

    def observe(self, arrival: Arrival) -> bool:
        """Take tracks of a camera that is not followed by; True if they may be used."""
        received = self.tracks.message(arrival, Tracks)
        if received is None:
            return False
        taken_s, wrong = self.times.taken_s(received.message, received.arrived_s)
        if wrong:
            return False
        self.newest = replace(received, taken_s=taken_s)
        return True

    def hear(self, topic: str, arrival: Arrival) -> None:
        """Take its clock or its description.

        Raises:
            MessageError: a description that cannot be read.
        """
        if topic == "info":
            self.infos.hear(decode(CameraInfo, arrival.payload, arrival.encoding))
        elif self.taken is not None and arrival.encoding != EndOfStream.encoding():
            received = self.taken.message(arrival, Taken)
            if received is not None:
                self.times.hear(received.message, received.arrived_s)

    def news(self, now_s: float) -> CameraInfo | None:
        """Its description, once for each start of the camera.

        Raises:
            MessageError: a description that cannot be read.
        """
        if self.newest is None or self.info_epoch == self.newest.message.epoch:
            return None
        info = self.infos.of(self.newest.message.epoch)
        if info is None and (answered := self.info_asked.poll(now_s)) is not None:
            self.infos.hear(answered)
            info = self.infos.of(self.newest.message.epoch)
        if info is not None:
            self.info_epoch = info.epoch
        return info


def open_eye(context: ServiceContext[FollowerServiceSettings], camera: str, first: bool) -> Eye:
    """Subscribe to a camera.

    Args:
        context: of the follower.
        camera: its name.
        first: whether it is the one that the follower begins with.
    """
    suffix, live = "" if first else f"@{camera}", context.settings.delivery == "live"
    tracks = context.subscribe(f"tracks{suffix}", keys.tracks(camera), qos.TRACKS, primary=first)
    taken = None
    if live:
        # In a lossless run the stream is the clock; what comes beside it has no place in it.
        context.inbox.subscribe(f"info{suffix}", keys.info(camera), qos.INFO)
        taken = context.subscribe(f"taken{suffix}", keys.taken(camera), qos.TAKEN, primary=False)
    return Eye(
        camera, tracks, taken, FrameTimes(monotonic_clock()), CameraInfos(camera),
        LatchedQuery(context.session, keys.info(camera), CameraInfo),
    )  # fmt: skip


def of_camera(topic: str, first: str) -> tuple[str, str] | None:
    """Topic and camera of a message of any camera; None of every other message."""
    name, _, camera = topic.partition("@")
    return (name, camera or first) if name in _OF_CAMERAS else None
