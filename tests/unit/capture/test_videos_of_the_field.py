"""Videos as cameras, phones and recorders write them: interlaced, turned, cut, of uneven rate."""

from __future__ import annotations

import gc
import os
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from av.video.stream import VideoStream
from numpy.typing import NDArray

from heel.schemas.errors import SourceError
from heel.services.capture.decoding import upright
from heel.services.capture.source import Frame
from heel.services.capture.sources import open_source
from heel.services.capture.video_file import VideoFileSource
from tests.unit.capture.videos import encode_video, index_of, picture

TOP_FIRST = {"x264-params": "tff=1"}


def frames_of(path: Path) -> tuple[list[Frame], str]:
    """All frames of a file, and how it ended; any warning fails the test."""
    with VideoFileSource(path, pytest.fail) as source:
        frames = list(iter(source.read, None))
        return frames, source.end_reason


def pictures(count: int) -> list[NDArray[np.uint8]]:
    return [picture(index) for index in range(count)]


def two_fields(index: int, step: int = 4) -> NDArray[np.uint8]:
    """A light bar that moves on by `step` pixels from field to field, top field first."""
    image = np.full((96, 128, 3), 40, np.uint8)
    left = 20 + 2 * step * index
    image[0::2, left : left + 20] = 200
    image[1::2, left + step : left + step + 20] = 200
    return image


@pytest.mark.parametrize(
    ("suffix", "codec", "options"),
    [(".mp4", "libx264", TOP_FIRST), (".ts", "mpeg2video", {"flags": "+ilme+ildct"})],
)
def test_interlaced_video_is_decoded_and_comes_out_whole(
    tmp_path: Path, suffix: str, codec: str, options: dict[str, str]
) -> None:
    images = pictures(10)
    frames, end = frames_of(encode_video(tmp_path / f"v{suffix}", images, codec, options=options))
    assert end == "end of file"
    assert [index_of(frame.image) for frame in frames] == list(range(10))
    assert [frame.index for frame in frames] == list(range(10))
    assert [frame.media_time_s for frame in frames] == pytest.approx(np.arange(10) / 25)


def test_the_fields_of_interlaced_video_show_no_comb(tmp_path: Path) -> None:
    images = [two_fields(index) for index in range(6)]
    assert comb_of(images[3]) > 5
    options = TOP_FIRST | {"crf": "10"}
    frames, _ = frames_of(encode_video(tmp_path / "v.mp4", images, options=options))
    assert comb_of(frames[3].image) < 2
    assert frames[3].image[48, 50:60].mean() > 150


def comb_of(image: NDArray[np.uint8]) -> float:
    """How far lines differ from the mean of their neighbours, grey levels."""
    grey = image[:, :, 1].astype(float)
    return float(np.abs(grey[2:-2] - (grey[1:-3] + grey[3:-1]) / 2).mean())


def test_av1_is_decoded(tmp_path: Path) -> None:
    path = encode_video(tmp_path / "v.mp4", pictures(6), "libsvtav1", options={"preset": "12"})
    frames, end = frames_of(path)
    assert end == "end of file"
    assert [index_of(frame.image) for frame in frames] == list(range(6))


@pytest.mark.parametrize("suffix", [".mp4", ".mkv"])
def test_time_stamps_are_the_streams_own_and_gaps_are_no_damage(
    tmp_path: Path, suffix: str
) -> None:
    ticks = [0, 1, 2, 10, 11, 1511, 1512]
    frames, end = frames_of(encode_video(tmp_path / f"v{suffix}", pictures(7), ticks=ticks))
    assert end == "end of file"
    assert [frame.index for frame in frames] == list(range(7))
    times_s = [frame.media_time_s for frame in frames]
    assert times_s == pytest.approx([tick / 25 for tick in ticks], abs=0.002)


def test_a_cut_without_coding_is_no_damage_although_it_holds_frames_that_are_not_shown(
    tmp_path: Path,
) -> None:
    """Edit lists, as phones and `ffmpeg -ss 1.3 -c copy` write them: frames before 0 are hidden."""
    ticks = list(range(-4, 6))
    path = encode_video(tmp_path / "v.mp4", pictures(10), ticks=ticks, options={"bf": "0"})
    frames, end = frames_of(path)
    assert end == "end of file"
    assert [index_of(frame.image) for frame in frames] == list(range(4, 10))
    assert [frame.index for frame in frames] == list(range(6))


def test_recordings_one_behind_the_other_go_on_in_time(tmp_path: Path) -> None:
    part = encode_video(tmp_path / "a.ts", pictures(5), "mpeg2video").read_bytes()
    twice = tmp_path / "twice.ts"
    twice.write_bytes(part + part)
    frames, end = frames_of(twice)
    assert end == "end of file"
    assert len(frames) == 10
    assert np.all(np.diff([frame.media_time_s for frame in frames]) > 0)
    assert frames[-1].media_time_s == pytest.approx(0.36, abs=0.1)


def _corners() -> NDArray[np.uint8]:
    image = np.zeros((48, 64, 3), np.uint8)
    image[:24, :32], image[:24, 32:], image[24:, :32], image[24:, 32:] = 40, 100, 160, 220
    return image


@pytest.mark.parametrize(
    "matrix",
    [(1, 0, 0, 1), (-1, 0, 0, 1), (1, 0, 0, -1), (-1, 0, 0, -1),
     (0, 1, 1, 0), (0, 1, -1, 0), (0, -1, 1, 0), (0, -1, -1, 0)],
)  # fmt: skip
def test_a_display_matrix_is_applied_once_mirrored_ones_too(
    tmp_path: Path, matrix: tuple[int, int, int, int]
) -> None:
    frames, _ = frames_of(encode_video(tmp_path / "v.mp4", [_corners()] * 2, matrix=matrix))
    shown = frames[0].image
    a, b, c, d = matrix
    assert shown.shape == ((64, 48, 3) if b else (48, 64, 3))
    assert (frames[0].source_height, frames[0].source_width) == shown.shape[:2]
    for x, y, level in ((-1, -1, 40), (1, -1, 100), (-1, 1, 160), (1, 1, 220)):
        column, row = a * x + c * y, b * x + d * y
        seen = shown[row * 12 + shown.shape[0] // 2, column * 12 + shown.shape[1] // 2]
        assert np.abs(seen.astype(int) - level).max() < 12
    assert upright(_corners(), matrix).shape == shown.shape


def test_damage_in_the_middle_leaves_numbers_out_and_the_rest_is_shown(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    images = [rng.integers(0, 255, (48, 64, 3)).astype(np.uint8) for _ in range(40)]
    path = encode_video(tmp_path / "v.mkv", images, "mjpeg")
    data = bytearray(path.read_bytes())
    start = len(data) // 2
    data[start : start + 9000] = bytes(9000)
    path.write_bytes(data)
    warnings: list[str] = []
    with VideoFileSource(path, warnings.append) as source:
        frames = list(iter(source.read, None))
    assert len(frames) < 40
    assert frames[-1].index == 39
    assert frames[-1].media_time_s == pytest.approx(39 / 25, abs=0.01)
    assert source.end_reason == warnings[0]
    assert "damaged" in warnings[0]


def test_frames_that_a_recorder_dropped_are_no_damage(tmp_path: Path) -> None:
    """An AVI names them in its count and keeps a chunk without bytes for each."""
    path = encode_video(tmp_path / "v.avi", pictures(3), "mjpeg", ticks=[0, 4, 5])
    with av.open(str(path)) as container:
        assert container.streams.video[0].frames == 6
    frames, end = frames_of(path)
    assert end == "end of file"
    assert [frame.media_time_s for frame in frames] == pytest.approx([0.0, 0.16, 0.2])


def test_a_file_name_that_is_not_utf8_is_read_and_can_be_named(tmp_path: Path) -> None:
    name = os.fsdecode(b"caf\xe9.mp4")
    encode_video(tmp_path / "v.mp4", pictures(2)).rename(tmp_path / name)
    with open_source(str(tmp_path / name)) as source:
        assert source.read() is not None
        assert source.name.encode().endswith(rb"caf\xe9.mp4")


def test_an_animated_png_is_a_recording_of_all_its_pictures(tmp_path: Path) -> None:
    path = tmp_path / "walk.png"
    with av.open(str(path), "w", format="apng") as container:
        stream = container.add_stream("apng", rate=10)
        assert isinstance(stream, VideoStream)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "rgb24"
        for index in range(4):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture(index), "bgr24")))
        container.mux(stream.encode(None))
    with open_source(str(path)) as source:
        assert [index_of(frame.image) for frame in iter(source.read, None)] == [0, 1, 2, 3]


def test_sound_alone_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "sound.wav"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000)
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), "s16", "mono")
        sound.sample_rate = 8000
        container.mux(stream.encode(sound))
    with pytest.raises(SourceError, match="no video"):
        VideoFileSource(path)


def test_a_picture_larger_than_8k_is_refused_before_memory_is_taken_for_it(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bomb.avi"
    jpeg = cv2.imencode(".jpg", np.zeros((12_000, 12_000), np.uint8), [1, 1])[1].tobytes()
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mjpeg", rate=25)
        assert isinstance(stream, VideoStream)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuvj420p"
        packet = av.Packet(jpeg)
        packet.stream, packet.pts, packet.time_base = stream, 0, Fraction(1, 25)
        container.mux(packet)
    with pytest.raises(SourceError, match="no frame of its mjpeg video can be decoded"):
        VideoFileSource(path)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("options", [{}, TOP_FIRST], ids=["progressive", "interlaced"])
def test_no_frame_stays_in_memory_until_the_collector_comes_round(
    tmp_path: Path, options: dict[str, str]
) -> None:
    path = encode_video(tmp_path / "v.mp4", pictures(13) * 4, options=options)
    gc.collect()
    gc.disable()
    try:
        with VideoFileSource(path) as source:
            while source.read() is not None:
                pass
            kept = [one for one in gc.get_objects() if str(type(one).__module__).startswith("av.")]
        frames = [one for one in kept if "Frame" in type(one).__name__]
        sides = [one for one in kept if "SideData" in type(one).__name__]
    finally:
        gc.enable()
    assert len(frames) <= 12
    assert len(sides) <= 6
