"""The bridge as a process: the robot's camera, ranges and odometry in, the drive's velocities out.

The drive is the gate: what it says goes to ROS at its own rate, and once it is silent for a moment
zero does, as long as this process lives. The robot's own watchdog (of twist_mux or the base) has to
stop it when this process does not.
"""

from __future__ import annotations

import math
import secrets
import time
from contextlib import ExitStack, suppress
from typing import Any

import cv2

from heel.schemas import (
    CameraInfo,
    DriveState,
    EndOfStream,
    EStop,
    FollowState,
    HeelError,
    MessageError,
    Ranges,
    Taken,
    decode,
    keys,
)
from heel.schemas.frame import LensModel
from heel.services.geometry.camera import camera_from_info
from heel.services.geometry.pixels import fit_to_cap
from heel.services.geometry.ros_pictures import Picture, compressed_picture_of, picture_of
from heel.services.ros2.check import check
from heel.services.ros2.convert import (
    OdometryReader,
    lens_of,
    sectors_of,
)
from heel.services.ros2.depth import DepthPairs, obstacles, stamp_ns
from heel.services.ros2.joining import joined
from heel.services.ros2.node import Heard, RosNode
from heel.services.ros2.settings import Ros2Settings
from heel.services.ros2.telling import Telling
from heel.services.runtime import qos
from heel.services.runtime.clock import monotonic_clock
from heel.services.runtime.images import (
    DepthPublisher,
    ImagePublisher,
    StreamIdentity,
    image_header,
)
from heel.services.runtime.publishing import Latched
from heel.services.runtime.service import ServiceContext, run_service
from heel.services.runtime.settings import Loaded

_ROUND_S = 0.01
"""Longest wait for ROS in a round of the loop [s]: half a period of the drive."""
_SILENT_S = 0.2
"""Silence of the drive from which zero is sent in its place [s]; it speaks 50 times a second."""
_ZERO_S = 0.05
"""Time between zeros that are sent in its place [s]."""
_TOLD_S = 1.0
"""How long health tells of depth that cannot be read [s]; chosen by hand: some tens of pictures."""
_MOST_LATE_NS = 10_000_000_000
"""Oldest stamp of a picture that is believed [ns]: beyond it the two clocks differ; chosen by
hand."""


class Bridge:
    """Carries messages between one robot's ROS and one run of Heel."""

    def __init__(
        self, context: ServiceContext[Ros2Settings], node: RosNode, resources: ExitStack
    ) -> None:
        s, session = context.settings, context.session
        self._context, self._settings, self._node = context, s, node
        self._identity = StreamIdentity(s.camera, secrets.randbits(63), context.producer)
        self._drive = context.subscribe("drive", keys.ROBOT_DRIVE, qos.DRIVE)
        # Latched, without a stamp: no stream to be judged.
        context.inbox.subscribe("state", keys.FOLLOW_STATE, qos.STATE)
        self._info = resources.enter_context(Latched(session, keys.info(s.camera), qos.INFO))
        self._estop = resources.enter_context(
            Latched(session, keys.FOLLOW_ESTOP, qos.ESTOP, context.producer)
        )
        self._taken = context.publisher(keys.taken(s.camera), qos.TAKEN)
        self._image = ImagePublisher(context, s.jpeg_quality, None)
        self._odometry = context.publisher(keys.ROBOT_ODOMETRY, qos.ODOMETRY)
        self._ranges = context.publisher(keys.ROBOT_RANGE, qos.RANGES)
        self._depth = DepthPublisher(context) if s.depth_topic else None
        self._pairs = DepthPairs()
        self._telling = Telling(context, node)
        self._state: FollowState | None = None
        self._reader = OdometryReader()
        self._frames = self._scans = 0
        self._described: tuple[object, ...] | None = None
        self._described_as: CameraInfo | None = None
        self._lens_message: Any = None
        self._drive_s = -math.inf
        self._zero_s = -math.inf

    def run(self) -> None:
        """Bridge until the service is stopped."""
        context = self._context
        context.announce()
        while context.running:
            self._node.arrived.wait(_ROUND_S)
            if self._node.failure is not None:
                raise HeelError(f"ROS 2 ended: {self._node.failure}: start the bridge again")
            self._hear(self._node.take())
            self._command(time.monotonic())
            self._say_target()
            self._telling.tell(time.monotonic(), self._state)
        end = EndOfStream(
            stream=self._identity.stream, epoch=self._identity.epoch, frames=self._frames,
            reason="the bridge to ROS 2 was stopped",
        )  # fmt: skip
        self._image.end(end)
        context.linger()

    def _hear(self, heard: Heard) -> None:
        now_s = time.monotonic()
        for name, reason in heard.unread.items():
            self._context.warn.warning(f"ros {name}", reason, now_s)
        if heard.stops:
            self._stop()
        if heard.info is not None:
            self._lens_message = heard.info
        if heard.odometry is not None:
            told = self._reader.read(heard.odometry)
            if told is None:
                self._context.warn.warning("odometry", "odometry that is no number", now_s)
            else:
                self._odometry.send(told, 0.0)
        if heard.scan is not None:
            self._scan(heard.scan, now_s)
        if heard.picture is not None:
            self._picture(heard, now_s)
        if self._depth is not None:
            self._measure(self._depth, heard.depth, now_s)

    def _stop(self) -> None:
        message = EStop(
            engaged=True, source=f"ROS topic {self._settings.estop_topic}"[:96],
            t_ns=time.time_ns(), id=secrets.token_hex(8),
        )  # fmt: skip
        self._estop.set(message)
        self._context.log.warning("STOP by ROS topic %s", self._settings.estop_topic)

    def _scan(self, scan: Any, now_s: float) -> None:
        try:
            sectors = sectors_of(scan, math.radians(self._settings.scan_yaw_deg))
        except HeelError as error:
            self._context.warn.warning("scan", f"{error}", now_s)
            return
        self._ranges.send(Ranges(seq=self._scans, sectors=sectors), 0.0)
        self._scans += 1

    def _measure(self, publisher: DepthPublisher, message: Any, now_s: float) -> None:
        """Pass depth on, and what it shows in the way where there is no scanner."""
        try:
            found = self._pairs.depth(message)
            if found is not None:
                header, depth_mm = found
                publisher.send(self._identity, header, depth_mm, header.age_ns)
        except HeelError as error:
            self._context.warn.warning("depth", f"{error}", now_s)
            self._context.statistics.problem("depth", f"no depth: {error}", now_s + _TOLD_S)
            return
        info = self._described_as
        if found is None or info is None or self._settings.scan_topic:
            return
        sectors = obstacles(found[1], info)
        if sectors is not None:
            self._ranges.send(Ranges(seq=self._scans, sectors=sectors), 0.0)
            self._scans += 1

    def _picture(self, heard: Heard, now_s: float) -> None:
        compressed = hasattr(heard.picture, "format")
        try:
            picture = (compressed_picture_of if compressed else picture_of)(heard.picture)
        except HeelError as error:
            reason = f"no picture: {error}"
            if self._context.statistics.problem("picture", reason):
                self._context.log.error("%s", reason)
            return
        self._context.statistics.problem("picture", None)
        size = picture.shape[1], picture.shape[0]
        picture = fit_to_cap(picture)
        self._describe(picture, size, now_s)
        late_ns = self._node.now_ns() - stamp_ns(heard.picture.header)
        waited_ns = time.monotonic_ns() - heard.picture_ns
        # An unset stamp, or another machine's clock, tells nothing: the arrival counts.
        age_ns = late_ns if waited_ns <= late_ns <= _MOST_LATE_NS else waited_ns
        seq = self._frames
        header = image_header(
            self._identity, picture, (seq, seq), size, time.time_ns() - age_ns, age_ns
        )
        taken = Taken(
            stream=self._identity.stream, epoch=self._identity.epoch, seq=seq,
            clock=monotonic_clock(), monotonic_ns=time.monotonic_ns() - age_ns,
        )  # fmt: skip
        self._taken.send(taken, 0.0)
        self._image.send(header, picture)
        self._pairs.picture(heard.picture.header, header)
        self._telling.picture(header.epoch, seq, heard.picture.header)
        self._frames += 1
        done_s = time.monotonic()
        self._context.statistics.output(done_s, done_s - now_s, age_ns * 1e-9 + done_s - now_s)

    def _describe(self, picture: Picture, size: tuple[int, int], now_s: float) -> None:
        """Say what is known of the camera, once it is known or has changed."""
        height, width = picture.shape[:2]
        lens: LensModel | None = None
        if self._lens_message is not None:
            try:
                lens = lens_of(self._lens_message, width, height)
            except HeelError as error:
                self._context.warn.warning("lens", f"{error}", now_s)
        if (told := (width, height, size, lens)) == self._described:
            return
        self._described, s = told, self._settings
        radians = None if s.horizontal_fov_deg is None else math.radians(s.horizontal_fov_deg)
        info = CameraInfo(
            stream=s.camera, epoch=self._identity.epoch, width=width, height=height,
            source_width=size[0], source_height=size[1], fps=s.fps,
            source=f"ROS topic {s.image_topic}"[:512], horizontal_fov_rad=radians,
            mount_height_m=s.mount_height_m,
            mount_pitch_rad=None if s.mount_pitch_deg is None else math.radians(s.mount_pitch_deg),
            lens=lens, host=monotonic_clock(),
        )  # fmt: skip
        camera = None if lens is None else camera_from_info(info)
        if camera is not None:
            info = info.model_copy(update={"horizontal_fov_rad": camera.horizontal_fov_rad})
        self._described_as = info
        self._info.set(info)

    def _command(self, now_s: float) -> None:
        arrival = self._context.inbox.latest("drive")
        received = None if arrival is None else self._drive.message(arrival, DriveState)
        if arrival is not None and received is not None:
            self._context.statistics.input(arrival.arrived_s)
            self._drive_s = now_s
            self._node.send(received.message.linear_mps, received.message.angular_radps)
            self._context.statistics.problem("drive", None)
            return
        silent_s = now_s - self._drive_s
        if silent_s > _SILENT_S and now_s - self._zero_s >= _ZERO_S and silent_s < math.inf:
            self._zero_s = now_s
            self._node.send(0.0, 0.0)
            reason = f"the drive is silent for more than {_SILENT_S:g} s: zero velocity"
            if self._context.statistics.problem("drive", reason):
                self._context.log.info("%s", reason)

    def _say_target(self) -> None:
        arrival = self._context.inbox.latest("state")
        if arrival is None:
            return
        try:
            self._state = state = decode(FollowState, arrival.payload, arrival.encoding)
        except MessageError as error:
            self._context.warn.warning("state", f"{error}", arrival.arrived_s)
            return
        if state.state == "following" and None not in (state.distance_m, state.bearing_rad):
            distance_m, bearing_rad = state.distance_m or 0.0, state.bearing_rad or 0.0
            self._node.send_target(
                distance_m * math.cos(bearing_rad), distance_m * math.sin(bearing_rad)
            )


def serve(context: ServiceContext[Ros2Settings]) -> None:
    """Bridge until the service is stopped."""
    with ExitStack() as resources:
        node = resources.enter_context(joined(context.settings))
        Bridge(context, node, resources).run()


def run(loaded: Loaded[Ros2Settings]) -> int:
    """Run the bridge; returns its exit code."""
    cv2.setNumThreads(1)
    if loaded.service.check:
        with suppress(BrokenPipeError):
            return check(loaded.service)
    return run_service("ros2", loaded, serve)
