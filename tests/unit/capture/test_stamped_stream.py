"""A live H.264 stream with time stamps, over HTTP as MPEG-TS: joined anywhere, stalled, behind."""

from __future__ import annotations

import io
import time
from fractions import Fraction

import av
import pytest
from av.video.stream import VideoStream

from heel.services.capture.camera import open_stream
from heel.services.capture.source import SourceTimeout
from tests.unit.capture.http_server import HttpServer, Request, number_of, numbered_picture

PATIENCE_S = 20.0
FPS = 25
KEY_FRAME_EVERY = 50


@pytest.fixture(scope="module")
def parts() -> list[bytes]:
    """The stream, cut into what each of its pictures takes; a key frame every 2 s."""
    file, parts, taken = io.BytesIO(), [], 0
    options = {"flush_packets": "1", "pat_period": "0.04"}
    with av.open(file, "w", format="mpegts", options=options) as container:
        stream = container.add_stream(
            "libx264", rate=FPS, options={"preset": "ultrafast", "tune": "zerolatency"}
        )
        assert isinstance(stream, VideoStream)
        stream.width, stream.height, stream.pix_fmt = 256, 64, "yuv420p"
        stream.gop_size = KEY_FRAME_EVERY
        for number in range(160):
            frame = av.VideoFrame.from_ndarray(numbered_picture(number), "bgr24")
            frame.pts, frame.time_base = number, Fraction(1, FPS)
            container.mux(stream.encode(frame))
            parts.append(file.getvalue()[taken:])
            taken = len(file.getvalue())
    return parts


class Camera:
    """Sends each picture when it is taken, but for what waits in a stall.

    Args:
        parts: of the stream.
        first: number of the picture that a client gets first.
        at_once: how many it gets at once when it connects, from before.
        stall: pictures between these numbers arrive with the last of them.
    """

    def __init__(
        self, parts: list[bytes], first: int, at_once: int = 0, stall: tuple[int, int] = (0, 0)
    ) -> None:
        self._parts, self._first, self._at_once, self._stall = parts, first, at_once, stall
        self.begun_s = 0.0

    def taken_s(self, number: int) -> float:
        """When a picture is taken."""
        return self.begun_s + (number - self._first - self._at_once) / FPS

    def __call__(self, request: Request) -> None:
        """Serve one client."""
        request.send_response(200)
        request.send_header("Content-Type", "video/mp2t")
        request.end_headers()
        self.begun_s = time.monotonic()
        for number in range(self._first, len(self._parts)):
            goes = self._stall[1] if self._stall[0] <= number < self._stall[1] else number
            if request.stopping.wait(max(0.0, self.taken_s(goes) - time.monotonic())):
                return
            request.wfile.write(self._parts[number])
            request.wfile.flush()


def hidden_ages_s(camera: Camera, until: int) -> dict[int, float]:
    """How much older than it says each picture is that comes before number `until`, seconds."""
    hidden: dict[int, float] = {}
    with HttpServer({"/live": camera}) as server:
        with open_stream(server.address("/live"), open_timeout_s=PATIENCE_S) as source:
            assert source.is_live
            deadline = time.monotonic() + PATIENCE_S
            while time.monotonic() < deadline and max(hidden, default=0) < until:
                try:
                    frame = source.read(0.2)
                except SourceTimeout:
                    continue
                assert frame is not None
                assert frame.acquired_ns is not None
                number = number_of(frame.image)
                hidden[number] = frame.acquired_ns * 1e-9 - camera.taken_s(number)
    return hidden


def test_a_stream_joined_between_key_frames_shows_whole_pictures_from_the_next_on(
    parts: list[bytes],
) -> None:
    hidden = hidden_ages_s(Camera(parts, first=KEY_FRAME_EVERY - 20), until=KEY_FRAME_EVERY + 20)
    assert min(hidden) >= KEY_FRAME_EVERY
    assert len(hidden) > 5
    assert max(hidden.values()) < 0.3


def test_pictures_that_waited_in_a_stall_are_as_old_as_their_time_stamps_say(
    parts: list[bytes],
) -> None:
    hidden = hidden_ages_s(Camera(parts, first=0, stall=(40, 70)), until=100)
    assert len(hidden) > 30
    assert max(hidden.values()) < 0.3


def test_what_the_server_had_kept_from_before_is_not_shown_as_new(parts: list[bytes]) -> None:
    """Relays send the last key frame and all that followed it, to show a picture at once."""
    hidden = hidden_ages_s(Camera(parts, first=0, at_once=45), until=80)
    assert max(hidden.values()) < 0.3
