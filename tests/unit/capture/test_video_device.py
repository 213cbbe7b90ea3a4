"""USB cameras by any name, and what they give in place of what was asked for."""

from __future__ import annotations

from pathlib import Path

import pytest

from heel.schemas.errors import SourceError
from heel.services.capture import camera, sources
from heel.services.capture.sources import open_source
from heel.services.capture.video_device import VideoDeviceFormat, device_number, differences


def test_a_device_is_known_by_its_name_and_by_links_to_it(tmp_path: Path) -> None:
    link = tmp_path / "usb-camera-video-index0"
    link.symlink_to("/dev/video7")
    assert device_number(Path("/dev/video7")) == 7
    assert device_number(link) == 7
    assert device_number(Path("/dev/null")) is None
    assert device_number(tmp_path) is None


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("/dev/v4l/by-id/usb-not-plugged-in", "no such camera; plug it in"),
        ("/dev/null", "not a V4L2 camera"),
    ],
)
def test_what_is_no_camera_is_refused_in_one_line(
    spec: str, words: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SourceError) as caught:
        open_source(spec)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


def test_size_rate_and_pixel_format_reach_the_device(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[VideoDeviceFormat | None] = []

    def refuse(path: Path, wanted: VideoDeviceFormat | None, *_: object) -> None:
        asked.append(wanted)
        raise SourceError(f"{path}: enough")

    monkeypatch.setattr(sources, "open_device", refuse)
    wanted = VideoDeviceFormat(1280, 720, fourcc="MJPG")
    with pytest.raises(SourceError, match="/dev/video3: enough"):
        open_source("3", fps=15.0, camera=wanted)
    assert asked == [VideoDeviceFormat(1280, 720, 15.0, "MJPG")]
    assert camera.open_device is not refuse


def test_what_a_device_gives_in_place_of_what_was_asked_for_is_told() -> None:
    wanted = VideoDeviceFormat(1280, 720, 30.0, "MJPG")
    given = VideoDeviceFormat(640, 480, 15.0, "YUYV")
    lines = differences(wanted, given)
    assert "640x480 in place of 1280x720" in lines[0]
    assert "15 frames/s in place of 30" in lines[1]
    assert "YUYV in place of MJPG" in lines[2]
    assert differences(wanted, wanted) == []
    assert differences(VideoDeviceFormat(), given) == []
    assert differences(VideoDeviceFormat(width=1280), given) == [
        "gives 640x480 in place of 1280x480; v4l2-ctl --list-formats-ext shows what the camera has"
    ]
