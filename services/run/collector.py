"""The receiving end of a run: writes files, counts, and grants credit for further frames."""

from __future__ import annotations

import time
from collections import OrderedDict, deque

import numpy as np
import zenoh
from numpy.typing import NDArray

from heel.schemas import (
    Blobs,
    CameraInfo,
    EndOfStream,
    FollowState,
    Health,
    MessageError,
    MotionCommand,
    Progress,
    Target,
    Tracks,
    decode,
    encode,
    keys,
)
from heel.schemas.image import decode_image
from heel.services.run.options import RunOptions
from heel.services.run.outputs import RunOutputs
from heel.services.run.summary import Camera, RunSummary
from heel.services.runtime import qos
from heel.services.runtime.chain import page_of
from heel.services.runtime.counters import ServiceStatistics
from heel.services.runtime.inbox import Arrival, Inbox
from heel.services.runtime.logs import OncePerSecond
from heel.services.runtime.registry import Registration
from heel.services.runtime.streams import Received, StreamJudge

CONSUMER = "run"
CAMERA = "front"
_KEPT_IMAGES = 16
"""Frames whose picture waits for its tracks, or the reverse, before it is left out of the film:
bounds the memory; chosen by hand."""
_KEPT_HEALTH = 64
"""Messages of health that wait for the run; it takes them with every message. Chosen by hand."""
# Rates of a film that players show [frames/s]; a camera may state anything. Chosen by hand.
_LEAST_FPS = 1.0
_MOST_FPS = 240.0


class Collector:
    """Consumes all messages of a run; one thread calls `take`."""

    def __init__(
        self,
        session: zenoh.Session,
        inbox: Inbox,
        options: RunOptions,
        outputs: RunOutputs,
        summary: RunSummary,
        warn: OncePerSecond,
        note: Registration,
    ) -> None:
        self._options, self._outputs, self._summary = options, outputs, summary
        self._note = note
        self._lossless = options.delivery == "lossless"
        self._statistics = ServiceStatistics()
        topics = {
            "blobs": (keys.blobs(CAMERA), qos.BLOBS), "tracks": (keys.tracks(CAMERA), qos.TRACKS),
            "command": (keys.FOLLOW_COMMAND, qos.COMMAND),
        }  # fmt: skip
        if outputs.film is not None:
            topics["image"] = (keys.image(CAMERA), qos.IMAGE)
        self._judges: dict[str, StreamJudge] = {}
        for topic, (key, quality) in topics.items():
            # This end writes a record: it keeps more than the newest message, in live mode too.
            quality = quality.for_delivery("lossless")
            inbox.subscribe(topic, key, quality)
            self._judges[topic] = StreamJudge(
                topic, quality, self._statistics, warn, live=not self._lossless
            )
        inbox.subscribe("health", keys.ALL_HEALTH, qos.HEALTH)
        inbox.subscribe("info", keys.info(CAMERA), qos.INFO)
        inbox.subscribe("target", keys.FOLLOW_TARGET, qos.TARGET)
        inbox.subscribe("state", keys.FOLLOW_STATE, qos.STATE.for_delivery("lossless"))
        self._join = _FrameJoin(frozenset(topics))
        self._progress = session.declare_publisher(
            keys.progress(CAMERA, CONSUMER), express=True,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )  # fmt: skip
        self._images: OrderedDict[tuple[int, int], NDArray[np.uint8]] = OrderedDict()
        self._waiting: OrderedDict[tuple[int, int], Tracks] = OrderedDict()
        self._command_frames: set[tuple[int, int]] = set()
        self._target_id: int | None = None
        self._ended: set[str] = set()
        self.health: deque[tuple[Health, float]] = deque(maxlen=_KEPT_HEALTH)
        """What services told of themselves, and when it came; for the run to take."""
        self.info: CameraInfo | None = None
        self._page_url = ""
        self.first_frame_s: float | None = None
        """Monotonic time at which the first frame was acquired, transit not counted."""
        self.last_frame_s = 0.0

    @property
    def ended(self) -> bool:
        """Whether tracks and commands have both announced their end."""
        for topic, judge in self._judges.items():
            if (end := judge.ended(time.monotonic())) is not None:
                self._ended.add(topic)
                self._summary.captured, self._summary.ended = end.frames, end.reason
        return self._ended >= {"tracks", "command"}

    def take(self, arrival: Arrival) -> None:
        """Handle one message; malformed ones are counted and dropped."""
        if arrival.topic in self._judges:
            if arrival.encoding == EndOfStream.encoding():
                self._judges[arrival.topic].ending(arrival)
            else:
                self._stream(arrival)
            return
        try:
            self._side(arrival)
        except MessageError as error:
            self._summary.malformed["run"] = self._summary.malformed.get("run", 0) + 1
            self._judges["tracks"].warn.warning(
                arrival.topic, f"{arrival.key}: {error}", arrival.arrived_s
            )

    def _side(self, arrival: Arrival) -> None:
        if arrival.topic == "health":
            health = decode(Health, arrival.payload, arrival.encoding)
            self.health.append((health, arrival.arrived_s))
            self._summary.missing[health.service] = health.dropped
            self._summary.malformed[health.service] = health.malformed
            self._summary.cpu_s[health.service] = health.cpu_s
            self._summary.peak_rss_mb[health.service] = health.peak_rss_mb
            self._page(page_of(health))
        elif arrival.topic == "info":
            self.info = info = decode(CameraInfo, arrival.payload, arrival.encoding)
            self._summary.camera = Camera(
                info.source, info.fps, info.source_width, info.source_height
            )
        elif arrival.topic == "state":
            self._outputs.state(decode(FollowState, arrival.payload, arrival.encoding))
        else:
            self._target_id = decode(Target, arrival.payload, arrival.encoding).track_id

    def _page(self, url: str | None) -> None:
        if not url or url == self._page_url:
            return
        self._page_url = url
        for tell in (self._note.page_is, self._options.on_page):
            if tell is not None:
                tell(url)

    def _stream(self, arrival: Arrival) -> None:
        judge = self._judges[arrival.topic]
        if arrival.topic == "image":
            self._image(arrival, judge)
        elif arrival.topic == "blobs":
            blobs = judge.message(arrival, Blobs)
            if blobs is not None:
                self._summary.detected += 1
                self._age("blobs", blobs, blobs.message.t_capture_ns)
                self._done("blobs", blobs.message.epoch, blobs.message.seq)
        elif arrival.topic == "tracks":
            tracks = judge.message(arrival, Tracks)
            if tracks is not None:
                self._tracks(tracks)
        else:
            command = judge.message(arrival, MotionCommand)
            if command is not None:
                self._command(command)

    def _tracks(self, received: Received[Tracks]) -> None:
        tracks = received.message
        self._summary.tracked += 1
        if self.first_frame_s is None:
            self.first_frame_s = received.arrived_s - received.stamp.age_ns * 1e-9
        self.last_frame_s = received.arrived_s
        self._outputs.tracks(tracks)
        self._age("tracks", received, tracks.t_capture_ns)
        if self._outputs.film is not None:
            self._waiting[tracks.epoch, tracks.seq] = tracks
            self._draw((tracks.epoch, tracks.seq))
            while len(self._waiting) > _KEPT_IMAGES:
                self._waiting.popitem(last=False)
        self._done("tracks", tracks.epoch, tracks.seq)

    def _image(self, arrival: Arrival, judge: StreamJudge) -> None:
        header = judge.header(arrival)
        if header is None:
            return
        try:
            image = decode_image(arrival.payload, header, arrival.encoding)
        except MessageError as error:
            judge.refuse(arrival, error)
            return
        self._images[header.epoch, header.seq] = image
        while len(self._images) > _KEPT_IMAGES:
            self._images.popitem(last=False)
        self._draw((header.epoch, header.seq))
        self._done("image", header.epoch, header.seq)

    def _draw(self, frame: tuple[int, int]) -> None:
        """Draw a frame as soon as both its picture and its tracks are here."""
        if self._outputs.film is None or frame not in self._images or frame not in self._waiting:
            return
        tracks = self._waiting.pop(frame)
        fps = min(max(_LEAST_FPS, self.info.fps), _MOST_FPS) if self.info else 25.0
        caption = f"frame {tracks.index + 1}"
        self._outputs.film.write(self._images.pop(frame), tracks, self._target_id, caption, fps)

    def _command(self, received: Received[MotionCommand]) -> None:
        command = received.message
        self._summary.commands += 1
        self._outputs.command(command)
        if command.frame is None:
            return
        frame = (command.frame.epoch, command.frame.seq)
        if frame not in self._command_frames:
            # The age that counts is that of the first command that rests on a frame.
            self._command_frames = {frame}
            self._age("command", received, command.frame.t_capture_ns)
        self._done("command", *frame)

    def _age(self, hop: str, received: Received[Tracks] | Received[Blobs] | Received[MotionCommand],
             t_capture_ns: int) -> None:  # fmt: skip
        """Note a frame's age at sending: by the wall clock when live, by residence otherwise."""
        stamp = received.stamp
        age_ns = stamp.age_ns if self._lossless else max(0, stamp.t_sent_ns - t_capture_ns)
        self._summary.age(hop, age_ns * 1e-9)

    def _done(self, part: str, epoch: int, seq: int) -> None:
        if not self._lossless:
            return
        newest = self._join.add(part, seq)
        if newest is not None:
            progress = Progress(stream=CAMERA, epoch=epoch, seq=newest)
            self._progress.put(encode(progress), encoding=Progress.encoding())


class _FrameJoin:
    """Collects the parts of each frame; frames are released in order, once all parts are there."""

    def __init__(self, parts: frozenset[str]) -> None:
        self._parts = parts
        self._have: dict[int, set[str]] = {}
        self._next = 0

    def add(self, part: str, seq: int) -> int | None:
        """Note a part; returns the newest frame that is complete with all before it, if new."""
        if seq >= self._next:
            self._have.setdefault(seq, set()).add(part)
        newest = None
        while self._have.get(self._next, set()) >= self._parts:
            del self._have[self._next]
            newest = self._next
            self._next += 1
        return newest
