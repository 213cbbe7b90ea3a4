"""From the world to tracks: with simulated boxes, or with rendered pixels and the detector."""

from __future__ import annotations

from typing import Protocol

from schemas import CameraInfo, FrameId, Tracks
from services.simulator.state import CameraMount

CAMERA = "front"


class Perception(Protocol):
    """What stands between the world and the follower."""

    def see(self, frame: FrameId) -> Tracks:
        """The people in the picture that the camera takes of the world now."""


def camera_info(mount: CameraMount) -> CameraInfo:
    """What the simulated camera says of itself."""
    return CameraInfo(
        stream=CAMERA,
        epoch=1,
        width=mount.width_px,
        height=mount.height_px,
        source_width=mount.width_px,
        source_height=mount.height_px,
        fps=mount.fps,
        source="simulated world",
        horizontal_fov_rad=mount.horizontal_fov_rad,
        mount_height_m=mount.height_m,
        mount_pitch_rad=mount.pitch_rad,
    )
