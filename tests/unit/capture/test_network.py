"""Addresses: recordings, live streams, snapshots, and what answers in place of them."""

from __future__ import annotations

import base64
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from heel.schemas.errors import SourceError
from heel.services.capture.camera import open_stream
from heel.services.capture.source import FrameSource, SourceTimeout
from heel.services.capture.sources import open_source
from heel.services.commands.run import is_camera
from tests.unit.capture.http_server import Answer, HttpServer, Request, number_of, numbered_jpeg
from tests.unit.capture.videos import encode_video, index_of, picture

PATIENCE_S = 20.0
PASSWORD = "gehe/im@77#?"
ESCAPED = "gehe%2Fim%4077%23%3F"


@pytest.fixture
def video(tmp_path: Path) -> bytes:
    images = [picture(index) for index in range(12)]
    return encode_video(tmp_path / "v.mp4", images).read_bytes()


def endless(request: Request) -> None:
    """20 pictures a second."""
    request.start_pictures()
    number = 0
    while not request.stopping.wait(0.05):
        request.send_picture(numbered_jpeg(number))
        number += 1


def silent(request: Request) -> None:
    """A head, and nothing behind it."""
    request.start_pictures()
    request.stopping.wait(PATIENCE_S)


def guarded(request: Request) -> None:
    """Wants user and password."""
    wanted = "Basic " + base64.b64encode(f"admin:{PASSWORD}".encode()).decode()
    if request.headers.get("Authorization") == wanted:
        endless(request)
        return
    request.send_response(401)
    request.send_header("WWW-Authenticate", 'Basic realm="camera"')
    request.send_header("Content-Length", "0")
    request.end_headers()


def page(request: Request) -> None:
    request.send_body(b"<html><body>camera</body></html>", "text/html")


def broken(request: Request) -> None:
    request.send_error(500)


def read_all(source: FrameSource) -> list[int]:
    deadline, numbers = time.monotonic() + PATIENCE_S, list[int]()
    while time.monotonic() < deadline:
        try:
            frame = source.read(0.2)
        except SourceTimeout:
            continue
        if frame is None:
            return numbers
        numbers.append(index_of(frame.image))
    raise AssertionError("the recording does not end")


def test_a_recording_on_a_server_is_played_once_like_a_file(video: bytes) -> None:
    with HttpServer({"/v.mp4": lambda request: request.send_body(video)}) as server:
        with open_source(server.address("/v.mp4"), warn=pytest.fail) as source:
            assert not source.is_live
            assert source.frame_count == 12
            assert read_all(source) == list(range(12))
            assert source.end_reason == "end of file"


def test_a_run_without_a_word_on_delivery_waits_for_a_recording_and_not_for_a_camera(
    video: bytes,
) -> None:
    answers: dict[str, Answer] = {"/v.mp4": lambda r: r.send_body(video), "/live": endless}
    with HttpServer(answers) as server:
        assert not is_camera(server.address("/v.mp4"))
        assert is_camera(server.address("/live"))
        assert is_camera(server.address("/nothing"))
    assert is_camera("/dev/v4l/by-id/usb-camera")
    assert is_camera("rtsp://10.0.0.2/main")
    assert not is_camera("walk.mp4")


def test_a_recording_on_a_server_can_be_looped(video: bytes) -> None:
    with HttpServer({"/v.mp4": lambda request: request.send_body(video)}) as server:
        with open_source(server.address("/v.mp4"), loop=True) as source:
            frames = [source.read() for _ in range(30)]
    assert [frame.index for frame in frames if frame] == list(range(30))


def test_a_recording_whose_server_stalls_keeps_its_deadline_and_says_what_is_missing(
    tmp_path: Path,
) -> None:
    rng = np.random.default_rng(2)
    images = [rng.integers(0, 255, (48, 64, 3)).astype(np.uint8) for _ in range(60)]
    body = encode_video(tmp_path / "v.mkv", images, "mjpeg").read_bytes()

    def half(request: Request) -> None:
        request.send_response(200)
        request.send_header("Content-Length", str(len(body)))
        request.end_headers()
        request.wfile.write(body[: len(body) // 2])
        request.wfile.flush()
        request.stopping.wait(PATIENCE_S)

    warnings: list[str] = []
    with HttpServer({"/v.mkv": half}) as server:
        with open_stream(server.address("/v.mkv"), 1.0, warnings.append) as source:
            count = 0
            while True:
                started = time.monotonic()
                try:
                    frame = source.read(0.1)
                except SourceTimeout:
                    assert time.monotonic() - started < PATIENCE_S / 4
                    continue
                if frame is None:
                    break
                count += 1
    assert 10 < count < 50
    assert f"ended after {count} frames" in warnings[0]


@pytest.mark.parametrize(
    ("path", "user", "words"),
    [
        ("/guarded", "", "check user and password"),
        ("/guarded", "admin:wrong", "check user and password"),
        ("/nothing", "", "(404); check the path"),
        ("/page", "", "a web page, perhaps"),
        ("/broken", "", "answers with an error"),
        ("/silent", "", "no picture within 0.5 s"),
        ("/guarded", f"admin:{PASSWORD}", "%40 %2F %3F %23"),
    ],
)
def test_what_is_no_camera_is_told_from_what_wants_a_password(
    path: str, user: str, words: str, capfd: pytest.CaptureFixture[str]
) -> None:
    answers: dict[str, Answer] = {
        "/guarded": guarded, "/page": page, "/broken": broken, "/silent": silent,
    }  # fmt: skip
    with HttpServer(answers) as server:
        with pytest.raises(SourceError) as caught:
            open_stream(server.address(path, user), 0.5)
    said = str(caught.value)
    assert words in said
    assert said.count("127.0.0.1") == 1
    assert "\n" not in said
    assert "gehe" not in said
    assert "wrong" not in said
    assert capfd.readouterr().err == ""


def _playlist(entry: str) -> bytes:
    head = "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n"
    return f"{head}{entry}\n#EXT-X-ENDLIST\n".encode()


def test_playlists_and_redirects_cross_no_border_between_network_and_disk(
    tmp_path: Path, video: bytes
) -> None:
    secret = tmp_path / "v.mp4"

    def redirect(request: Request) -> None:
        request.send_response(302)
        request.send_header("Location", f"file://{secret}")
        request.send_header("Content-Length", "0")
        request.end_headers()

    answers: dict[str, Answer] = {
        "/v.mp4": lambda request: request.send_body(video),
        "/list.m3u8": lambda request: request.send_body(_playlist(f"file://{secret}")),
        "/redirect": redirect,
    }
    with HttpServer(answers) as server:
        for path in ("/list.m3u8", "/redirect"):
            with pytest.raises(SourceError):
                open_stream(server.address(path), 1.0)
        local = tmp_path / "list.m3u8"
        local.write_bytes(_playlist(server.address("/v.mp4")))
        with pytest.raises(SourceError):
            open_source(str(local))
        assert server.requests == ["/list.m3u8", "/redirect"]


def test_a_password_with_its_characters_escaped_opens() -> None:
    with HttpServer({"/guarded": guarded}) as server:
        with open_stream(server.address("/guarded", f"admin:{ESCAPED}")) as source:
            assert source.is_live
            assert source.read(PATIENCE_S) is not None
            assert "gehe" not in source.name


def test_a_capital_scheme_is_the_same_scheme() -> None:
    with HttpServer({"/v": endless}) as server:
        with open_source(server.address("/v").replace("http", "HTTP")) as source:
            assert source.read(PATIENCE_S) is not None


def test_an_opening_is_stopped_at_once_while_the_camera_is_silent() -> None:
    stop = threading.Event()
    threading.Timer(0.2, stop.set).start()
    with HttpServer({"/v": silent}) as server:
        started = time.monotonic()
        with pytest.raises(SourceError, match="when told to end"):
            open_stream(server.address("/v"), 3.0, stop=stop)
        assert time.monotonic() - started < 2.0


def test_a_camera_that_gives_one_picture_a_request_is_asked_again_and_again() -> None:
    sent = iter(range(1000))

    def snapshot(request: Request) -> None:
        request.send_body(numbered_jpeg(next(sent)), "image/jpeg")

    with HttpServer({"/snapshot.jpg": snapshot}) as server:
        address = server.address("/snapshot.jpg")
        with open_stream(address, warn=pytest.fail, fps=20.0) as source:
            frames = [source.read(PATIENCE_S) for _ in range(6)]
            assert source.is_live
            assert source.status.state == "connected"
    numbers = [number_of(frame.image) for frame in frames if frame]
    assert numbers == sorted(set(numbers))


@pytest.mark.parametrize("stall_s", [0.6, 1.5])
def test_pictures_that_waited_in_a_stalled_link_do_not_pass_for_new(stall_s: float) -> None:
    """The camera takes 20 pictures a second all the time; the link stands still for a while."""
    begun = time.monotonic()

    def stalling(request: Request) -> None:
        request.start_pictures()
        for number in range(10_000):
            due_s = begun + number * 0.05
            if request.stopping.wait(max(0.0, due_s - time.monotonic())):
                return
            if 1.5 < time.monotonic() - begun < 1.5 + stall_s:
                request.stopping.wait(1.5 + stall_s - (time.monotonic() - begun))
            request.send_picture(numbered_jpeg(number))

    hidden_s = []
    with HttpServer({"/v": stalling}) as server:
        with open_stream(server.address("/v")) as source:
            while (now := time.monotonic()) - begun < 4.5:
                try:
                    frame = source.read(0.1)
                except SourceTimeout:
                    continue
                assert frame is not None
                assert frame.acquired_ns is not None
                taken_s = begun + number_of(frame.image) * 0.05
                now = time.monotonic()
                hidden_s.append((now - taken_s) - (now - frame.acquired_ns * 1e-9))
    assert len(hidden_s) > 20
    assert max(hidden_s) < 0.3, "an old picture says that it is new"


def test_pictures_that_arrive_cut_off_are_no_pictures() -> None:
    def cutting(request: Request) -> None:
        request.start_pictures()
        number = 0
        while not request.stopping.wait(0.02):
            jpeg = numbered_jpeg(number)
            request.send_picture(jpeg if number < 10 else jpeg[: len(jpeg) // 2])
            number += 1

    with HttpServer({"/v": cutting}) as server:
        with open_stream(server.address("/v"), 0.5) as source:
            last = -1
            deadline = time.monotonic() + PATIENCE_S
            while source.status.state == "connected" and time.monotonic() < deadline:
                try:
                    frame = source.read(0.1)
                except SourceTimeout:
                    continue
                assert frame is not None
                last = number_of(frame.image)
            assert last == 9
            assert source.status.state == "stalled"
            assert "cut off or damaged" in source.status.last_error


def test_a_slow_camera_whose_rate_is_given_is_not_taken_for_a_lost_one() -> None:
    def slow(request: Request) -> None:
        request.start_pictures()
        number = 0
        while not request.stopping.wait(0.6):
            request.send_picture(numbered_jpeg(number))
            number += 1

    with HttpServer({"/v": slow}) as server:
        with open_stream(server.address("/v"), 0.3, pytest.fail, fps=1.0) as source:
            for _ in range(3):
                assert source.read(PATIENCE_S) is not None
            assert source.status.reconnects == 0
        assert len(server.requests) == 1
