"""Video files: whole, damaged, and not videos at all."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from heel.schemas.errors import SourceError
from heel.services.capture.source import DEFAULT_FPS, plausible_fps
from heel.services.capture.sources import open_source
from heel.services.capture.video_file import VideoFileSource
from tests.unit.capture.videos import index_of, write_noise_video, write_video


@pytest.mark.parametrize(
    ("suffix", "codec"), [(".mp4", "mp4v"), (".avi", "MJPG"), (".mkv", "mp4v")]
)
def test_every_frame_comes_once_in_order_at_its_time(
    tmp_path: Path, suffix: str, codec: str
) -> None:
    path = write_video(tmp_path / f"v{suffix}", 12, codec)
    with VideoFileSource(path) as source:
        assert (source.width, source.height, source.fps) == (64, 48, 10.0)
        assert not source.is_live
        frames = list(iter(source.read, None))
    assert [frame.index for frame in frames] == list(range(12))
    assert [index_of(frame.image) for frame in frames] == list(range(12))
    assert frames[11].media_time_s == pytest.approx(1.1)
    assert frames[0].image.dtype == np.uint8
    assert frames[0].image.flags.c_contiguous


def test_the_end_is_reported_and_stays_the_end(tmp_path: Path) -> None:
    with VideoFileSource(write_video(tmp_path / "v.mp4", 3)) as source:
        assert source.end_reason == ""
        assert len(list(iter(source.read, None))) == 3
        assert source.end_reason == "end of file"
        assert source.read() is None


def test_a_closed_file_gives_nothing_more(tmp_path: Path) -> None:
    source = VideoFileSource(write_video(tmp_path / "v.mp4", 3))
    source.close()
    source.close()
    assert source.read() is None
    assert source.end_reason == "closed"


@pytest.mark.parametrize("codec", ["MJPG", "XVID"])
def test_a_truncated_video_gives_what_precedes_the_damage_and_says_so(
    tmp_path: Path, codec: str, capfd: pytest.CaptureFixture[str]
) -> None:
    path = write_noise_video(tmp_path / "v.avi", 40, codec)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    warnings: list[str] = []
    with VideoFileSource(path, warnings.append) as source:
        frames = list(iter(source.read, None))
    assert 5 <= len(frames) < 35
    assert source.end_reason == warnings[0]
    assert f"{len(frames)} of 40 frames" in source.end_reason
    assert "truncated" in source.end_reason
    captured = capfd.readouterr()
    assert captured.err == "", "OpenCV or FFmpeg wrote to stderr"


def test_a_damaged_middle_does_not_end_in_an_exception(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = write_noise_video(tmp_path / "v.mp4", 40, "mp4v")
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 3000] = np.random.default_rng(1).bytes(3000)
    path.write_bytes(data)
    with VideoFileSource(path) as source:
        assert len(list(iter(source.read, None))) >= 5
    assert capfd.readouterr().err == ""


def _missing(folder: Path) -> Path:
    return folder / "missing.mp4"


def _empty(folder: Path) -> Path:
    (folder / "empty.mp4").touch()
    return folder / "empty.mp4"


def _text(folder: Path) -> Path:
    (folder / "notes.mp4").write_text("no video here\n" * 100)
    return folder / "notes.mp4"


def _headless(folder: Path) -> Path:
    path = write_noise_video(folder / "cut.mp4", 40, "mp4v")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    return path


def _pipe(folder: Path) -> Path:
    os.mkfifo(folder / "pipe.mp4")
    return folder / "pipe.mp4"


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (_missing, "no such file"),
        (_empty, "empty"),
        (_text, "not a video"),
        (_headless, "cut off"),
        (_pipe, "not a regular file"),
    ],
)
def test_what_is_no_video_is_refused_in_one_line_that_names_it(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], make: object, words: str
) -> None:
    assert callable(make)
    path = make(tmp_path)
    with pytest.raises(SourceError) as caught:
        open_source(str(path))
    message = str(caught.value)
    assert path.name in message
    assert words in message
    assert "\n" not in message
    assert capfd.readouterr().err == ""


def test_a_resolution_change_in_mid_stream_does_not_end_the_stream(tmp_path: Path) -> None:
    sizes = [(48, 64)] * 3 + [(96, 128)] * 3
    parts = [cv2.imencode(".jpg", np.full((*size, 3), 90, np.uint8))[1] for size in sizes]
    path = tmp_path / "v.mjpeg"
    path.write_bytes(b"".join(part.tobytes() for part in parts))
    with VideoFileSource(path) as source:
        shapes = [frame.image.shape for frame in iter(source.read, None)]
    assert shapes == [(48, 64, 3)] * 6


@pytest.mark.parametrize(("width", "height"), [(1, 1), (7680, 4320)])
def test_the_smallest_and_the_largest_frames_pass(tmp_path: Path, width: int, height: int) -> None:
    path = write_video(tmp_path / "v.avi", 2, "MJPG", width, height)
    with VideoFileSource(path) as source:
        frame = source.read()
    assert frame is not None
    assert frame.image.shape == (height, width, 3)


@pytest.mark.parametrize("stated", [0.0, -1.0, float("nan"), float("inf"), 1000.0, 90000.0])
def test_a_nonsensical_rate_becomes_the_default_with_a_warning(stated: float) -> None:
    warnings: list[str] = []
    assert plausible_fps(stated, "v.mp4", warnings.append) == DEFAULT_FPS
    assert "--fps" in warnings[0]


@pytest.mark.parametrize("stated", [0.5, 7.0, 29.97, 240.0])
def test_a_plausible_rate_is_kept(stated: float) -> None:
    assert plausible_fps(stated, "v.mp4", pytest.fail) == stated
