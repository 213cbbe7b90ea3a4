"""Cameras that are slow, stuck, lost, found again, or frozen."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas.errors import SourceError
from heel.services.capture.backoff import Backoff
from heel.services.capture.camera import open_stream
from heel.services.capture.device import Picture, RecordingEnded
from heel.services.capture.live import LiveSource
from heel.services.capture.source import SourceStatus, SourceTimeout
from tests.unit.capture.mjpeg_server import MjpegServer
from tests.unit.capture.videos import picture

QUICK = Backoff(first_s=0.01, limit_s=0.02)
PATIENCE_S = 20.0


class FakeDevice:
    """A camera whose every picture is released by the test."""

    def __init__(self, fps: float = 25.0) -> None:
        self.fps = fps
        self.complaint = ""
        self.late_s = 0.0
        self.released = threading.Event()
        self._pictures: list[NDArray[np.uint8] | SourceError | None] = []
        self._changed = threading.Condition()

    def give(self, *pictures: NDArray[np.uint8] | SourceError | None) -> None:
        """Queue pictures; None is a lost connection, an error any other end."""
        with self._changed:
            self._pictures.extend(pictures)
            self._changed.notify_all()

    def read(self) -> Picture:
        with self._changed:
            given = self._changed.wait_for(lambda: self._pictures, PATIENCE_S)
            image = self._pictures.pop(0) if given else None
        if image is None:
            raise SourceError("the camera stopped delivering pictures")
        if isinstance(image, SourceError):
            raise image
        return Picture(image, time.monotonic_ns() - round(self.late_s * 1e9))

    def interrupt(self) -> None:
        """Like a driver that cannot be interrupted."""

    def close(self) -> None:
        self.released.set()


def wait_until(condition: Callable[[], bool]) -> None:
    """Poll with a deadline; the source has no hook for tests and needs none."""
    deadline = time.monotonic() + PATIENCE_S
    pause = threading.Event()
    while not condition():
        assert time.monotonic() < deadline, "the condition did not come true in time"
        pause.wait(0.005)


def connected_to(*devices: FakeDevice | SourceError) -> Callable[[], FakeDevice]:
    """A `connect` that gives one device after the other; the last one for ever."""
    waiting = list(devices)

    def connect() -> FakeDevice:
        device = waiting.pop(0) if len(waiting) > 1 else waiting[0]
        if isinstance(device, SourceError):
            raise device
        return device

    return connect


def test_the_newest_frame_wins_and_the_index_shows_what_was_left_out() -> None:
    device = FakeDevice()
    device.give(picture(0))
    with LiveSource("camera", connected_to(device)) as source:
        first = source.read()
        device.give(picture(1), picture(2), picture(3), None)
        wait_until(lambda: source.status.state == "reconnecting")
        newest = source.read()
        device.give(picture(4))
    assert first is not None
    assert newest is not None
    assert (first.index, newest.index) == (0, 3)
    assert np.array_equal(newest.image, picture(3))
    assert newest.acquired_ns is not None
    assert newest.media_time_s > 0.0


def test_a_read_keeps_its_deadline_while_the_driver_is_stuck() -> None:
    device = FakeDevice()
    device.give(picture(0))
    with LiveSource("camera", connected_to(device), stall_after_s=0.09) as source:
        source.read()
        started = time.monotonic()
        with pytest.raises(SourceTimeout, match=r"no frame for 0\.1 s"):
            source.read(timeout_s=0.1)
        assert time.monotonic() - started < 2.0
        states = [source.status.state]

        def connected_by_a_picture() -> bool:
            device.give(picture(1))
            return source.status.state == "connected"

        wait_until(connected_by_a_picture)
        assert source.read(timeout_s=PATIENCE_S) is not None
    assert states == ["stalled"]


def test_close_returns_while_the_driver_is_stuck_and_the_camera_is_released_later() -> None:
    device = FakeDevice()
    device.give(picture(0))
    source = LiveSource("camera", connected_to(device))
    started = time.monotonic()
    source.close()
    assert time.monotonic() - started < 3.0
    assert source.read() is None
    assert source.status.state == "closed"
    device.give(picture(1))
    assert device.released.wait(PATIENCE_S)


def test_close_wakes_a_waiting_reader() -> None:
    device = FakeDevice()
    device.give(picture(0))
    source = LiveSource("camera", connected_to(device))
    source.read()
    results: list[object] = []
    reader = threading.Thread(target=lambda: results.append(source.read(PATIENCE_S)))
    reader.start()
    source.close()
    reader.join(PATIENCE_S)
    device.give(None)
    assert results == [None]


def test_a_lost_camera_is_connected_again_and_both_are_told_once() -> None:
    first, second = FakeDevice(), FakeDevice()
    first.give(picture(0), None)
    lost = SourceError("unplugged")
    warnings: list[str] = []
    with LiveSource(
        "camera", connected_to(first, lost, lost, second), backoff=QUICK, warn=warnings.append
    ) as source:
        wait_until(lambda: source.status.attempt >= 3)
        assert source.status.state == "reconnecting"
        assert source.status.last_error == "unplugged"
        second.give(picture(1))
        wait_until(lambda: source.status.reconnects == 1)
        assert source.status == SourceStatus("connected", 0, 1, "unplugged")
        frame = source.read()
        second.give(None)
    assert frame is not None
    assert frame.index == 1
    assert [("connecting again" in line) or ("connected again" in line) for line in warnings] == [
        True,
        True,
    ]
    assert first.released.is_set()


def detailed(seed: int) -> NDArray[np.uint8]:
    """A picture with contrast: one without shows nothing."""
    return np.random.default_rng(seed).integers(0, 256, (48, 64, 3), np.uint8)


def test_a_camera_that_repeats_the_same_bytes_is_reported_as_frozen() -> None:
    device = FakeDevice()
    device.give(detailed(0))
    still = detailed(5)
    with LiveSource("camera", connected_to(device), frozen_after_s=0.02) as source:

        def frozen_by_another() -> bool:
            device.give(still)
            return source.status.state == "frozen"

        wait_until(frozen_by_another)
        device.give(detailed(6))
        wait_until(lambda: source.status.state == "connected")
        device.give(None)


def test_a_picture_that_repeats_is_as_old_as_when_it_came_first() -> None:
    """So a frozen camera goes stale for everybody behind it, within their own limits."""
    device = FakeDevice()
    device.give(detailed(0))
    with LiveSource("camera", connected_to(device)) as source:
        frames = [source.read(5.0)]
        for number in (0, 0, 1):
            device.give(detailed(number))
            frames.append(source.read(5.0))
        device.give(None)
    acquired_ns = [frame.acquired_ns for frame in frames if frame is not None]
    new_ns = [frame.new_ns for frame in frames if frame is not None]
    assert acquired_ns == sorted(set(acquired_ns))
    assert new_ns == [acquired_ns[0]] * 3 + [acquired_ns[3]]


def test_a_picture_that_came_late_is_as_old_as_it_is_and_the_status_says_so() -> None:
    device = FakeDevice()
    device.late_s = 0.5
    device.give(detailed(0))
    with LiveSource("camera", connected_to(device)) as source:
        frame = source.read(PATIENCE_S)
        assert frame is not None
        assert frame.acquired_ns is not None
        assert time.monotonic_ns() - frame.acquired_ns >= 0.5e9
        assert source.status.state == "behind"
        assert "late" in source.status.last_error
        device.late_s = 0.0

        def well_after_another() -> bool:
            device.give(detailed(int(time.monotonic_ns() % 1000)))
            return source.status.state == "connected"

        wait_until(well_after_another)
        device.give(None)


def test_what_is_said_of_a_frozen_camera_is_not_what_was_said_of_a_lost_one() -> None:
    first, second = FakeDevice(), FakeDevice()
    first.give(detailed(0), None)
    second.give(detailed(1))
    with LiveSource(
        "camera", connected_to(first, second), frozen_after_s=0.02, backoff=QUICK
    ) as source:

        def frozen_by_another() -> bool:
            second.give(detailed(1))
            return source.status.state == "frozen"

        wait_until(frozen_by_another)
        assert "very same picture" in source.status.last_error
        second.give(np.zeros((48, 64, 3), np.uint8))
        wait_until(lambda: "no contrast" in source.status.last_error)
        second.give(None)


def test_a_stream_that_announced_its_end_ends_and_is_not_opened_again() -> None:
    device = FakeDevice()
    device.give(picture(0), RecordingEnded("end of the recording"))
    with LiveSource("camera", connected_to(device)) as source:
        assert source.read(PATIENCE_S) is not None
        assert source.read(PATIENCE_S) is None
    assert source.end_reason == "end of the recording"


def test_an_opening_ends_at_once_when_told_to() -> None:
    device, stop = FakeDevice(), threading.Event()
    threading.Timer(0.2, stop.set).start()
    started = time.monotonic()
    with pytest.raises(SourceError, match=r"no picture within 0\.\d s, when told to end"):
        LiveSource("camera", connected_to(device), open_timeout_s=PATIENCE_S, stop=stop)
    assert time.monotonic() - started < PATIENCE_S / 2
    device.give(None)


def test_data_without_a_key_frame_is_waited_for_longer_and_named() -> None:
    device, warnings = FakeDevice(), list[str]()
    device.complaint = "data arrives, no key frame yet"
    threading.Timer(0.5, device.give, [picture(0)]).start()
    with LiveSource(
        "camera", connected_to(device), 0.1, warn=warnings.append, patience_s=PATIENCE_S
    ) as source:
        assert source.read(PATIENCE_S) is not None
        device.give(None)
    assert warnings[0] == "camera: data arrives, no key frame yet; waiting on"


def test_a_camera_that_cannot_be_opened_at_first_is_refused_at_once() -> None:
    error = SourceError("the device cannot be opened")
    started = time.monotonic()
    with pytest.raises(SourceError, match="camera: the device cannot be opened; check"):
        LiveSource("camera", connected_to(error))
    assert time.monotonic() - started < 5.0


def test_a_camera_that_never_gives_a_picture_is_refused_in_time() -> None:
    device = FakeDevice()
    with pytest.raises(SourceError, match=r"no picture within 0\.1 s"):
        LiveSource("camera", connected_to(device), open_timeout_s=0.1)
    device.give(None)


def test_an_http_camera_delivers_frames_with_size_and_rate(
    capfd: pytest.CaptureFixture[str],
) -> None:
    with MjpegServer() as server, open_stream(server.video, open_timeout_s=PATIENCE_S) as source:
        frames = [source.read(PATIENCE_S) for _ in range(5)]
        assert source.is_live
        assert (source.width, source.height) == (64, 48)
        assert source.fps > 0
    indices = [frame.index for frame in frames if frame]
    assert len(indices) == 5
    assert indices == sorted(set(indices))
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("fault", ["stall", "hang up"])
def test_an_http_camera_that_fails_and_returns_is_followed(
    fault: str, capfd: pytest.CaptureFixture[str]
) -> None:
    warnings: list[str] = []
    with MjpegServer() as server:
        with open_stream(server.video, 0.5, warnings.append, PATIENCE_S) as source:
            source.read(PATIENCE_S)
            server.behaviour = "stall" if fault == "stall" else "hang up"
            wait_until(lambda: source.status.state == "reconnecting")
            with pytest.raises(SourceTimeout):
                # The first read may take a picture that came before the fault.
                assert [source.read(0.05) for _ in range(2)] == []
            server.behaviour = "refuse"
            wait_until(lambda: source.status.attempt >= 2)
            server.behaviour = "stream"
            wait_until(lambda: source.status.state == "connected")
            assert source.status.reconnects >= 1
            assert source.read(PATIENCE_S) is not None
            started = time.monotonic()
        assert time.monotonic() - started < 3.0
    assert "connected again" in warnings[-1]
    assert capfd.readouterr().err == ""
