"""A depth camera as Heel's camera: `python realsense_camera.py [SETTING=VALUE ...]`.

Sends pictures, the depth aligned to them, and what the depth shows in the way. Written for Intel's
RealSense after the documentation of `pyrealsense2` (`pip install pyrealsense2`) and **not tried on
one**: a test runs it on a stand-in. For an OAK or any other camera replace `RealSense`.
"""

import math
import secrets
import sys
import time
from contextlib import ExitStack

import numpy as np
from pydantic import Field

from heel.schemas import CameraInfo, HeelError, Ranges, Taken, keys
from heel.schemas.frame import LensModel
from heel.services.geometry.camera import GroundCamera, camera_from_info
from heel.services.geometry.depth import depth_sectors
from heel.services.runtime import qos
from heel.services.runtime.clock import monotonic_clock
from heel.services.runtime.frame_memory import FrameMemory
from heel.services.runtime.images import (
    DepthPublisher,
    ImagePublisher,
    StreamIdentity,
    image_header,
)
from heel.services.runtime.publishing import Latched
from heel.services.runtime.service import ServiceContext, run_service
from heel.services.runtime.settings import ServiceSettings, load_settings

WAIT_MS = 2000
FRAMES_IN_FLIGHT = 8


class Settings(ServiceSettings):
    """What is asked of the camera, and where it is mounted."""

    width_px: int = Field(640, description="of pictures and depth")
    height_px: int = Field(480, description="likewise")
    fps: int = Field(30, description="pictures per second")
    mount_height_m: float | None = Field(None, description="camera above ground, m")
    mount_pitch_deg: float | None = Field(None, description="camera pitch, degrees, down positive")


class RealSense:
    """The camera; `read` gives (H, W, 3) BGR and (H, W) uint16 mm of one moment."""

    def __init__(self, settings: Settings) -> None:
        try:
            import pyrealsense2 as rs
        except ImportError:
            raise HeelError("pyrealsense2 is not installed: pip install pyrealsense2") from None
        size = settings.width_px, settings.height_px
        self._pipeline, config = rs.pipeline(), rs.config()
        config.enable_stream(rs.stream.color, *size, rs.format.bgr8, settings.fps)
        config.enable_stream(rs.stream.depth, *size, rs.format.z16, settings.fps)
        profile = self._pipeline.start(config)
        self._mm = 1000.0 * profile.get_device().first_depth_sensor().get_depth_scale()
        self._align = rs.align(rs.stream.color)
        told = profile.get_stream(rs.stream.color).as_video_stream_profile().get_intrinsics()
        # OpenCV's order of coefficients; the colour camera's distortion is Brown's, or none.
        self.lens = LensModel(
            model="plumb_bob", focal_px=(told.fx, told.fy), centre_px=(told.ppx, told.ppy),
            coefficients=tuple(told.coeffs),
        )  # fmt: skip

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        try:
            frames = self._align.process(self._pipeline.wait_for_frames(WAIT_MS))
        except RuntimeError as error:
            raise HeelError(f"the camera is silent ({error}): check its cable") from None
        raw = np.asanyarray(frames.get_depth_frame().get_data())
        depth_mm = np.clip(np.rint(raw * self._mm), 0, 65535).astype(np.uint16)
        return np.array(frames.get_color_frame().get_data()), depth_mm

    def close(self) -> None:
        self._pipeline.stop()


def serve(context: ServiceContext[Settings]) -> None:
    s, session = context.settings, context.session
    with ExitStack() as resources:
        camera = RealSense(s)
        resources.callback(camera.close)
        identity = StreamIdentity(s.camera, secrets.randbits(63), context.producer)
        pitch_rad = None if s.mount_pitch_deg is None else math.radians(s.mount_pitch_deg)
        info = CameraInfo(
            stream=s.camera, epoch=identity.epoch, width=s.width_px, height=s.height_px,
            source_width=s.width_px, source_height=s.height_px, fps=float(s.fps),
            source="RealSense", lens=camera.lens, mount_height_m=s.mount_height_m,
            mount_pitch_rad=pitch_rad, host=monotonic_clock(),
        )  # fmt: skip
        ground = camera_from_info(info)
        resources.enter_context(Latched(session, keys.info(s.camera), qos.INFO)).set(info)
        images = ImagePublisher(context, 90, FrameMemory(FRAMES_IN_FLIGHT, context.log))
        depths = DepthPublisher(context)
        taken = context.publisher(keys.taken(s.camera), qos.TAKEN)
        ranges = context.publisher(keys.ROBOT_RANGE, qos.RANGES)
        context.announce()
        seq = 0
        while context.running:
            picture, depth_mm = camera.read()
            now_ns, now_s = time.monotonic_ns(), time.monotonic()
            taken.send(Taken(stream=s.camera, epoch=identity.epoch, seq=seq,
                             clock=monotonic_clock(), monotonic_ns=now_ns), 0.0)  # fmt: skip
            size = s.width_px, s.height_px
            header = image_header(identity, picture, (seq, seq), size, time.time_ns(), 0)
            images.send(header, picture)
            depths.send(identity, header, depth_mm, 0)
            if isinstance(ground, GroundCamera):
                ranges.send(Ranges(seq=seq, sectors=depth_sectors(depth_mm, ground)), 0.0)
            context.statistics.input(now_s)
            context.statistics.output(time.monotonic(), time.monotonic() - now_s, 0.0)
            seq += 1


if __name__ == "__main__":
    flags: dict[str, dict[str, object]] = {"capture": {}, "zenoh": {}}
    for word in sys.argv[1:]:
        name, _, value = word.partition("=")
        flags["zenoh" if name == "connect" else "capture"][name] = value
    sys.exit(run_service("capture", load_settings("capture", Settings, flags), serve))
