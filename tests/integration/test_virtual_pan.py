"""The capture process with a virtual pan: what the wheels are told turns its picture."""

from __future__ import annotations

import csv
import math
import queue
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh

from heel.schemas import CameraInfo, DriveState, Header, Odometry, decode, encode, keys
from heel.schemas.image import decode_image
from tests.support import network
from tests.support.processes import finished, running

SCENE = "pan:scene:demo?seed=3&frames=2000?width=320&height=240"


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    with network.router() as address:
        yield address


def told(seq: int, angular_radps: float) -> bytes:
    return encode(
        DriveState(
            seq=seq, state="driving", reason="test", estop=False, driver="log",
            linear_mps=0.0, angular_radps=angular_radps,
        )
    )  # fmt: skip


def offsets(file: Path) -> dict[int, float]:
    """Left edge of the window by index of the frame."""
    with file.open() as lines:
        return {int(row["frame"]) - 1: float(row["left_px"]) for row in csv.DictReader(lines)}


def test_the_window_turns_with_the_wheels_and_stands_when_the_drive_falls_silent(
    endpoint: str, tmp_path: Path
) -> None:
    file = tmp_path / "window.csv"
    source = f"{SCENE}&window_file={file}"
    with (
        network.client(endpoint) as session,
        network.collected(session, keys.image("front")) as images,
        network.collected(session, keys.info("front")) as infos,
        network.collected(session, keys.ROBOT_ODOMETRY) as odometry,
    ):
        drive = session.declare_publisher(keys.ROBOT_DRIVE)
        with running("-m", "heel.services.capture", source, "--connect", endpoint,
                     "--no-shared-memory") as process:  # fmt: skip
            info = decode(CameraInfo, infos.get(timeout=30.0).payload.to_bytes())
            first = _frame(images)
            for seq in range(40):
                drive.put(told(seq, 0.4), encoding=DriveState.encoding())
                turned = _frame(images)
            for _ in range(12):
                before = _frame(images)
            for _ in range(5):
                standing = _frame(images)
            code, _ = process.stop(15, 10.0)
    assert code == 0, process
    assert (info.width, info.height) == (320, 240)
    assert info.horizontal_fov_rad == pytest.approx(1.0472, abs=1e-3)
    lefts = offsets(file)
    assert lefts[first.index] == 160.0
    # Left is positive: the window moves to smaller columns, and by no more than was told.
    assert lefts[turned.index] < 160.0 - 20.0
    assert lefts[standing.index] == lefts[before.index]
    headings = [
        decode(Odometry, sample.payload.to_bytes()).heading_rad for sample in odometry.queue
    ]
    assert headings[0] == 0.0
    assert 160.0 - 277.1 * math.tan(headings[-1]) == pytest.approx(lefts[standing.index], abs=0.1)


def test_garbage_on_the_drive_s_topic_turns_nothing_and_is_counted(
    endpoint: str, tmp_path: Path
) -> None:
    file = tmp_path / "window.csv"
    with (
        network.client(endpoint) as session,
        network.collected(session, keys.image("front")) as images,
    ):
        drive = session.declare_publisher(keys.ROBOT_DRIVE)
        with running("-m", "heel.services.capture", f"{SCENE}&window_file={file}", "--connect",
                     endpoint, "--no-shared-memory") as process:  # fmt: skip
            _frame(images)
            for _ in range(10):
                drive.put(b"\xff\x00nonsense", encoding=DriveState.encoding())
                _frame(images)
            code, _ = process.stop(15, 10.0)
            stderr = process.stderr()
    assert code == 0
    assert "robot/drive" in stderr
    assert set(offsets(file).values()) == {160.0}


def test_a_lossless_run_of_a_virtual_pan_is_refused_with_the_remedy(endpoint: str) -> None:
    code, _, stderr = finished(
        "-m", "heel.services.capture", SCENE, "--connect", endpoint, "--delivery", "lossless"
    )
    assert code == 2
    assert "--delivery live" in stderr


def _frame(images: queue.Queue[zenoh.Sample]) -> Header:
    """The header of the next picture, whose size is checked."""
    sample = images.get(timeout=30.0)
    assert sample.attachment is not None
    header = decode(Header, sample.attachment.to_bytes())
    assert (header.width, header.height) == (320, 240)
    picture = decode_image(sample.payload.to_bytes(), header, header.image_encoding)
    assert picture.shape == (240, 320, 3)
    return header
