"""Settings of the capture process."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, Field

from heel.schemas.base import Name
from heel.services.runtime.settings import ServiceSettings, split_list


class CaptureSettings(ServiceSettings):
    """Where frames come from, how fast they go out, and what is known of the camera."""

    source: str = Field(
        "scene:demo",
        description="video file, recording of heel record (.mcap), image folder, MOTChallenge "
        "sequence, /dev/videoN, rtsp:// or http:// address, scene:NAME, or pan:RECORDING, a window "
        "that turns with the robot",
        json_schema_extra={"positional": True},
    )
    scale: float = Field(1.0, gt=0, le=1, description="factor for both sides of every frame")
    fps: float | None = Field(
        None, gt=0, le=240, description="frames per second instead of the source's own"
    )
    camera_width: int | None = Field(
        None, ge=16, le=7680, description="asked of a camera at /dev/videoN, pixels"
    )
    camera_height: int | None = Field(
        None, ge=16, le=4320, description="asked of a camera at /dev/videoN, pixels"
    )
    camera_fourcc: str | None = Field(
        None, pattern=r"^[ -~]{4}$", description="pixel format asked of a camera at /dev/videoN: "
        "MJPG where raw pictures fill the USB bus"
    )  # fmt: skip
    loop: bool = Field(False, description="play a recording again and again")
    frames: int | None = Field(None, ge=1, description="end after this many frames")
    jpeg_quality: int = Field(
        90, ge=1, le=100, description="quality of the JPEGs that go to other hosts, percent"
    )
    await_consumers: Annotated[tuple[Name, ...], BeforeValidator(split_list)] = Field(
        (), description="lossless: whose progress lets further frames go, comma separated"
    )
    consumer_timeout_s: float = Field(
        20.0, gt=0, le=600, description="lossless: longest wait for listeners or their progress"
    )
    epoch: int | None = Field(
        None, ge=0, lt=2**63, description="fixed epoch for repeatable runs; random otherwise"
    )
    calibration: Path | None = Field(
        None, description="file of `heel calibrate person` that says how the camera is mounted"
    )
    lens: Path | None = Field(
        None,
        description="file of the lens and its distortion, of `heel calibrate board`, ROS "
        "(camera_info), OpenCV or Kalibr; wins over every field of view",
    )
    horizontal_fov_deg: float | None = Field(
        None,
        gt=0,
        lt=180,
        description="horizontal field of view of the camera, degrees; wins over the file",
    )
    mount_height_m: float | None = Field(None, ge=0, le=100, description="camera above ground, m")
    mount_pitch_deg: float | None = Field(
        None, ge=-90, le=90, description="camera pitch, degrees, down is positive"
    )
    mount_yaw_deg: float | None = Field(
        None, ge=-180, le=180, description="where the camera looks, degrees from the robot's "
        "ahead, left is positive; needed of each of several cameras"
    )  # fmt: skip
