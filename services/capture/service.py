"""Capture as a process: frames of a source go out as images, paced or as fast as allowed."""

from __future__ import annotations

import math
import secrets
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from heel.schemas import (
    CameraInfo,
    EndOfStream,
    Header,
    HeelError,
    MessageError,
    Progress,
    Taken,
    decode,
    keys,
)
from heel.schemas.errors import SettingsError
from heel.schemas.image import MAX_IMAGE_BYTES
from heel.services.capture.credit import CreditWindow
from heel.services.capture.describe import completed, mounting
from heel.services.capture.pan_topics import LISTEN_S, PanTopics
from heel.services.capture.settings import CaptureSettings
from heel.services.capture.source import Frame, FrameSource, SourceTimeout
from heel.services.capture.sources import open_source
from heel.services.capture.video_device import VideoDeviceFormat
from heel.services.geometry.pixels import fit_to_cap
from heel.services.runtime import qos
from heel.services.runtime.clock import monotonic_clock
from heel.services.runtime.frame_memory import LIVE_FRAMES, MOST_LIVE_FRAMES, FrameMemory
from heel.services.runtime.images import (
    DepthPublisher,
    ImagePublisher,
    StreamIdentity,
    image_header,
)
from heel.services.runtime.pacing import Pacer
from heel.services.runtime.publishing import Latched
from heel.services.runtime.service import LOOP_WAIT_S, ServiceContext, run_service
from heel.services.runtime.settings import Loaded


class CaptureService:
    """Sends the frames of one source until it ends."""

    def __init__(self, context: ServiceContext[CaptureSettings], source: FrameSource) -> None:
        self._context = context
        self._settings = context.settings
        window = source.window
        own = mounting(context.settings, None if window is None else window.fov_rad)
        self._mounting = completed(own, source.camera)
        self._source = source
        self._pan = None if window is None else PanTopics(context, window)
        self._lossless = context.settings.delivery == "lossless"
        epoch = context.settings.epoch
        self._identity = StreamIdentity(
            stream=context.settings.camera,
            epoch=secrets.randbits(63) if epoch is None else epoch,
            producer=context.producer,
        )
        self._pacer = None if self._lossless or source.is_live else Pacer(source.fps)
        self._credit = CreditWindow(
            context.settings.await_consumers, self._identity.epoch, qos.LOSSLESS_WINDOW_FRAMES
        )
        self._taken = context.publisher(keys.taken(context.settings.camera), qos.TAKEN)
        self._memory: FrameMemory | None = None
        if context.shared_memory:
            if self._lossless:
                self._memory = FrameMemory(qos.LOSSLESS_WINDOW_FRAMES + 2, context.log)
            else:
                self._memory = FrameMemory(LIVE_FRAMES, context.log, MOST_LIVE_FRAMES)
        self._out = ImagePublisher(context, context.settings.jpeg_quality, self._memory)
        self._depth = DepthPublisher(context) if source.has_depth else None
        self._info: Latched | None = None
        self._seq = 0
        self._shape: tuple[int, ...] | None = None

    def run(self) -> None:
        """Announce the camera, send every frame, announce the end."""
        context = self._context
        if self._lossless:
            context.subscribe("progress", keys.all_progress(self._settings.camera), qos.PROGRESS)
        with Latched(context.session, keys.info(self._settings.camera), qos.INFO) as self._info:
            self._make_room()
            context.announce()
            if self._lossless:
                self._await(lambda: self._out.raw.has_listeners, "a listener on the image topic")
            context.log.info("%s: %dx%d at %g frames/s", self._source.name, self._source.width,
                             self._source.height, self._source.fps)  # fmt: skip
            try:
                reason = self._send_all()
            except HeelError as error:
                # Listeners are told that nothing more comes, then the error goes its way.
                self._end(str(error)[:512])
                raise
            self._end(reason)

    def _make_room(self) -> None:
        """Take the memory for frames before the first one is due."""
        frame_bytes = 3 * self._source.width * self._source.height
        if self._memory is not None and frame_bytes <= MAX_IMAGE_BYTES:
            self._memory.make_room(frame_bytes)

    def _send_all(self) -> str:
        limit = self._settings.frames or math.inf
        while self._context.running:
            if self._seq >= limit:
                return f"{self._seq} frames as asked for"
            frame = self._read()
            if frame is None:
                if self._source.end_reason:
                    return self._source.end_reason
                continue
            if not self._wait_until_due(frame):
                continue
            self._send(frame)
        return "capture was stopped"

    def _read(self) -> Frame | None:
        """The next frame; None at the end, or when a camera is silent (then that is reported)."""
        try:
            if self._pan is None:
                frame = self._source.read(LOOP_WAIT_S)
            else:
                self._pan.turn(time.monotonic())
                frame = self._source.read(LISTEN_S)
        except SourceTimeout:
            frame = None
        status = self._source.status
        if status.state == "connected":
            self._report(None)
        elif status.state != "closed":
            attempt = f", attempt {status.attempt}" if status.attempt else ""
            self._report(f"camera {status.state}{attempt}: {status.last_error}".rstrip(": "))
        return frame

    def _wait_until_due(self, frame: Frame) -> bool:
        """Wait until the frame may go out; False if it is skipped or the service stops."""
        if self._lossless:
            self._await(lambda: self._credit.may_send(self._seq), "progress")
            return not self._context.stop.is_set()
        if self._pacer is None:
            return True
        position = frame.media_time_s * self._source.fps
        if self._pacer.frames_behind(position, time.monotonic()) > 0:
            self._context.statistics.dropped += 1
            return False
        while self._context.running:
            delay_s = self._pacer.delay_s(position, time.monotonic())
            if delay_s <= 0:
                return True
            self._context.stop.wait(min(delay_s, LOOP_WAIT_S))
        return False

    def _send(self, frame: Frame) -> None:
        started_ns = time.monotonic_ns()
        acquired_ns = frame.acquired_ns or started_ns
        now_ns = time.monotonic_ns()
        # A frozen or covered camera goes stale for all behind, and the robot stops.
        seen_ns = frame.new_ns or acquired_ns
        age_ns = 0 if self._lossless else max(0, now_ns - seen_ns)
        if not self._lossless:
            self._tell_taken(seen_ns, age_ns)
        t_capture_ns = (
            round(frame.media_time_s * 1e9)
            if self._lossless
            else time.time_ns() - max(0, now_ns - acquired_ns)
        )
        frame = replace(frame, image=fit_to_cap(frame.image))
        self._describe(frame)
        header = image_header(
            self._identity, frame.image, (self._seq, frame.index),
            (frame.source_width, frame.source_height), t_capture_ns, age_ns,
        )  # fmt: skip
        self._send_depth(header, frame)
        self._out.send(header, frame.image)
        self._seq += 1
        now_ns = time.monotonic_ns()
        self._context.statistics.input(acquired_ns * 1e-9)
        self._context.statistics.output(
            now_ns * 1e-9, (now_ns - started_ns) * 1e-9, (now_ns - acquired_ns) * 1e-9
        )

    def _send_depth(self, header: Header, frame: Frame) -> None:
        """Send the depth of a frame; a lossless run waits for it, so one without sends a zero."""
        if self._depth is None:
            return
        depth_mm = frame.depth_mm
        if depth_mm is None and self._lossless:
            depth_mm = np.zeros((1, 1), np.uint16)
        if depth_mm is not None:
            self._depth.send(self._identity, header, depth_mm, header.age_ns)

    def _tell_taken(self, monotonic_ns: int, age_ns: int) -> None:
        """Say when the frame was taken, before anything that takes time is done with it."""
        taken = Taken(
            stream=self._identity.stream, epoch=self._identity.epoch, seq=self._seq,
            clock=monotonic_clock(), monotonic_ns=monotonic_ns,
        )  # fmt: skip
        self._taken.send(taken, age_ns * 1e-9)

    def _describe(self, frame: Frame) -> None:
        """Publish the camera's description at the start and whenever the size changes."""
        if frame.image.shape == self._shape or self._info is None:
            return
        height, width = frame.image.shape[:2]
        if self._shape is not None:
            self._context.log.warning("frame size is now %dx%d", width, height)
        if (width, height) != (frame.source_width, frame.source_height):
            self._context.log.info("frames of %dx%d are sent as %dx%d", frame.source_width,
                                   frame.source_height, width, height)  # fmt: skip
        self._shape = frame.image.shape
        s = self._settings
        self._info.set(
            CameraInfo(
                stream=s.camera,
                epoch=self._identity.epoch,
                width=width,
                height=height,
                source_width=frame.source_width,
                source_height=frame.source_height,
                fps=self._source.fps,
                frame_count=self._source.frame_count,
                source=self._source.name[:512],
                horizontal_fov_rad=self._mounting.horizontal_fov_rad(width, height),
                mount_height_m=self._mounting.mount_height_m,
                mount_pitch_rad=self._mounting.mount_pitch_rad,
                lens=self._mounting.lens(width, height),
                mount_yaw_rad=self._mounting.mount_yaw_rad,
                host=monotonic_clock(),
                depth=self._lossless and self._depth is not None,
            )
        )

    def _await(self, condition: Callable[[], bool], what: str) -> None:
        """Wait for a condition that progress messages bring about.

        Raises:
            HeelError: it did not come within `consumer_timeout_s`.
        """
        deadline_s = time.monotonic() + self._settings.consumer_timeout_s
        while self._context.running and not condition():
            if time.monotonic() > deadline_s:
                raise HeelError(
                    f"lossless: no {what} within {self._settings.consumer_timeout_s:g} s (slowest: "
                    f"{self._credit.slowest()}): is every service running with --delivery lossless?"
                )
            arrival = self._context.inbox.get(0.05, "progress")
            if arrival is None:
                continue
            try:
                progress = decode(Progress, arrival.payload, arrival.encoding)
                if progress.seq >= self._seq:
                    raise MessageError(
                        f"progress: frame {progress.seq} is finished, but {self._seq} were sent: "
                        "report what was received"
                    )
            except MessageError as error:
                self._context.statistics.malformed += 1
                self._context.warn.warning("progress", f"{arrival.key}: {error}", arrival.arrived_s)
                continue
            self._credit.update(arrival.key.rpartition("/")[2], progress)

    def _end(self, reason: str) -> None:
        if not self._lossless:
            # A live receiver keeps one image only: let it take the last one before the end.
            self._context.stop.wait(min(0.5, 2.0 / self._source.fps))
        self._out.end(
            EndOfStream(
                stream=self._identity.stream,
                epoch=self._identity.epoch,
                frames=self._seq,
                reason=reason[:512],
            )
        )
        self._context.log.info("end of stream after %d frames: %s", self._seq, reason)
        self._context.linger()

    def _report(self, reason: str | None) -> None:
        if self._context.statistics.problem("camera", reason):
            if reason is None:
                self._context.log.info("camera: well again")
            else:
                self._context.log.warning("%s", reason)


def serve(context: ServiceContext[CaptureSettings]) -> None:
    """Open the source and send it."""
    s = context.settings
    camera = VideoDeviceFormat(s.camera_width, s.camera_height, fourcc=s.camera_fourcc)
    with open_source(
        s.source, scale=s.scale, fps=s.fps, loop=s.loop, warn=context.log.warning, camera=camera,
        stop=context.stop,
    ) as source:  # fmt: skip
        if source.is_live and source.window is None and s.delivery == "lossless":
            raise SettingsError(f"{source.name}: a camera does not wait: leave out lossless")
        CaptureService(context, source).run()


def run(loaded: Loaded[CaptureSettings]) -> int:
    """Run the capture process; returns its exit code."""
    return run_service("capture", loaded, serve)
