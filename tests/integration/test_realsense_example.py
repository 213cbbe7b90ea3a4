"""The example of a depth camera, on a stand-in for its library."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import numpy as np

from heel.schemas import CameraInfo, Header, Ranges, decode, keys
from heel.schemas.image import decode_depth, decode_image
from tests.support import network
from tests.support.network import wait_until
from tests.support.processes import REPOSITORY, running

EXAMPLE = REPOSITORY / "examples" / "realsense_camera.py"
STAND_IN = """
import time
from types import SimpleNamespace as Fields
import numpy as np

stream, format = Fields(color=1, depth=2), Fields(bgr8=1, z16=2)

class config:
    def enable_stream(self, *_): pass

class align:
    def __init__(self, to): assert to == stream.color
    def process(self, frames): return frames

class pipeline:
    def start(self, _):
        lens = Fields(fx=320.0, fy=320.0, ppx=320.0, ppy=240.0, coeffs=[0.0] * 5)
        video = Fields(get_intrinsics=lambda: lens)
        sensor = Fields(get_depth_scale=lambda: 0.0001)
        return Fields(
            get_device=lambda: Fields(first_depth_sensor=lambda: sensor),
            get_stream=lambda which: Fields(as_video_stream_profile=lambda: video),
        )
    def wait_for_frames(self, _):
        time.sleep(0.03)
        picture = np.full((480, 640, 3), 77, np.uint8)
        depth = np.full((480, 640), 15000, np.uint16)
        depth[:, :100] = 0
        return Fields(
            get_color_frame=lambda: Fields(get_data=lambda: picture),
            get_depth_frame=lambda: Fields(get_data=lambda: depth),
        )
    def stop(self): pass
"""


def test_pictures_depth_and_obstacles_arrive(tmp_path: Path) -> None:
    (tmp_path / "pyrealsense2.py").write_text(STAND_IN)
    with ExitStack() as stack:
        endpoint = stack.enter_context(network.router())
        session = stack.enter_context(network.client(endpoint))
        images, depths, ranges, infos = (
            stack.enter_context(network.collected(session, key))
            for key in (keys.image("front"), keys.depth("front"), keys.ROBOT_RANGE,
                        keys.info("front"))
        )  # fmt: skip
        command = (str(EXAMPLE), f"connect={endpoint}", "mount_height_m=0.5", "mount_pitch_deg=0")
        process = stack.enter_context(
            running(*command, PYTHONPATH=f"{tmp_path}:{REPOSITORY / 'src'}")
        )
        wait_until(
            lambda: min(images.qsize(), depths.qsize(), ranges.qsize(), infos.qsize()) > 0,
            "what the camera sees", 30.0,
        )  # fmt: skip
        assert process.alive
        image, depth, told = images.get(), depths.get(), infos.get()
    header = decode(Header, image.attachment.to_bytes())
    assert (decode_image(image.payload.to_bytes(), header, str(image.encoding)) == 77).all()
    header = decode(Header, depth.attachment.to_bytes())
    depth_mm = decode_depth(depth.payload.to_bytes(), header, str(depth.encoding))
    assert np.unique(depth_mm).tolist() == [0, 1500]
    info = decode(CameraInfo, told.payload.to_bytes())
    assert info.lens is not None
    assert info.lens.focal_px == (320.0, 320.0)
    sectors = decode(Ranges, ranges.get().payload.to_bytes()).sectors
    ahead = min(sectors, key=lambda sector: abs(sector.bearing_rad))
    assert abs(ahead.distance_m - 1.5) < 0.02
