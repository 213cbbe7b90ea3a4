"""Folders of pictures: order, gaps, odd formats, unreadable files, MOTChallenge layout."""

from __future__ import annotations

import os
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from heel.schemas.errors import SourceError
from heel.services.capture.frame_numbers import number_frames
from heel.services.capture.numbered_pictures import pictures_by_number
from heel.services.capture.picture_file import Stretch, picture_size, read_picture
from heel.services.capture.sources import open_source
from tests.unit.capture.videos import index_of, picture, write_folder, write_picture, write_video


def test_pictures_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    write_folder(tmp_path, [1, 2, 9, 10, 11], "frame{}.png")
    with open_source(str(tmp_path), warn=lambda _: None) as source:
        frames = list(iter(source.read, None))
    assert [index_of(frame.image) for frame in frames] == [1, 2, 9, 10, 11]


@pytest.mark.parametrize(
    ("names", "indices"),
    [
        (["000001", "000002", "000003"], [0, 1, 2]),
        (["0", "1", "2"], [0, 1, 2]),
        (["1", "2", "5"], [0, 1, 4]),
        (["cam2_img8", "cam2_img10", "cam2_img9"], [0, 1, 2]),
        (["apple", "pear"], [0, 1]),
        (["a1", "b1"], [0, 1]),
        (["1²3", "1²4"], [0, 1]),
        (["1700000000123", "1700000040456"], [0, 1]),
    ],
)
def test_the_index_follows_the_numbers_where_names_have_frame_numbers(
    names: list[str], indices: list[int]
) -> None:
    numbered, _ = number_frames([Path(f"{name}.jpg") for name in names])
    assert [index for index, _ in numbered] == indices


def test_a_gap_is_named_once_and_does_not_shift_later_frames(tmp_path: Path) -> None:
    write_folder(tmp_path, [1, 2, 5, 6, 8])
    warnings: list[str] = []
    with open_source(str(tmp_path), warn=warnings.append) as source:
        frames = list(iter(source.read, None))
    assert [frame.index for frame in frames] == [0, 1, 4, 5, 7]
    assert frames[2].media_time_s == pytest.approx(4 / 25)
    assert len(warnings) == 1
    assert "3-4, 7" in warnings[0]
    assert "3-4, 7" in source.end_reason


def test_an_unreadable_picture_is_skipped_and_named(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    write_folder(tmp_path, [1, 2, 3, 4, 5])
    (tmp_path / "000002.png").write_bytes(b"not a picture")
    whole = (tmp_path / "000004.png").read_bytes()
    (tmp_path / "000004.png").write_bytes(whole[: len(whole) // 2])
    warnings: list[str] = []
    with open_source(str(tmp_path), warn=warnings.append) as source:
        frames = list(iter(source.read, None))
    assert [frame.index for frame in frames] == [0, 2, 4]
    assert ["000002.png" in warnings[0], "000004.png" in warnings[1]] == [True, True]
    assert "2 unreadable" in source.end_reason
    assert capfd.readouterr().err == ""


def test_a_resolution_change_is_delivered_as_it_is(tmp_path: Path) -> None:
    write_picture(tmp_path / "1.png", picture(1, 64, 48))
    write_picture(tmp_path / "2.png", picture(2, 32, 24))
    with open_source(str(tmp_path)) as source:
        shapes = [frame.image.shape for frame in iter(source.read, None)]
    assert shapes == [(48, 64, 3), (24, 32, 3)]


@pytest.mark.parametrize(
    "image",
    [
        np.full((4, 6), 100, np.uint8),
        np.full((4, 6, 4), 100, np.uint8),
        np.full((4, 6), 100 << 8, np.uint16),
        np.full((4, 6, 3), 100 << 8, np.uint16),
    ],
    ids=["grey", "alpha", "grey16", "colour16"],
)
def test_every_depth_and_channel_count_becomes_bgr8(
    tmp_path: Path, image: np.ndarray[tuple[int, ...], np.dtype[np.uint8 | np.uint16]]
) -> None:
    decoded = read_picture(write_picture(tmp_path / "a.png", image))
    assert decoded.dtype == np.uint8
    assert decoded.shape == (4, 6, 3)
    assert np.all(np.abs(decoded.astype(int) - 100) <= 1)


def test_a_single_picture_is_a_recording_of_one_frame(tmp_path: Path) -> None:
    write_picture(tmp_path / "a.png", picture(3))
    with open_source(str(tmp_path / "a.png")) as source:
        assert len(list(iter(source.read, None))) == 1


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({}, "no pictures"),
        ({"a.txt": b"x"}, "no pictures"),
        ({"1.jpg": b"", "2.jpg": b"x"}, "none"),
    ],
)
def test_a_folder_without_readable_pictures_is_refused(
    tmp_path: Path, files: dict[str, bytes], words: str
) -> None:
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    with pytest.raises(SourceError, match=words) as caught:
        open_source(str(tmp_path), warn=lambda _: None)
    assert str(tmp_path) in str(caught.value)


def _sequence(folder: Path, text: str) -> Path:
    (folder / "seqinfo.ini").write_text("[Sequence]\nname=s\n" + text)
    return folder


def test_a_sequence_directory_takes_folder_rate_and_suffix_from_its_file(tmp_path: Path) -> None:
    write_folder(tmp_path / "img1", [1, 2, 3])
    _sequence(tmp_path, "imDir=img1\nframeRate=7\nseqLength=3\nimExt=.png\n")
    with open_source(str(tmp_path), warn=pytest.fail) as source:
        assert (source.fps, source.frame_count) == (7.0, 3)
        frames = list(iter(source.read, None))
    assert [frame.index for frame in frames] == [0, 1, 2]


def test_a_sequence_keeps_its_numbering_when_the_first_and_last_pictures_are_missing(
    tmp_path: Path,
) -> None:
    write_folder(tmp_path / "img1", [2, 3])
    _sequence(tmp_path, "imDir=img1\nframeRate=7\nseqLength=4\nimExt=.png\n")
    warnings: list[str] = []
    with open_source(str(tmp_path), warn=warnings.append) as source:
        frames = list(iter(source.read, None))
    assert [frame.index for frame in frames] == [1, 2]
    assert "1, 4" in warnings[0]


def test_a_sequence_may_name_one_video(tmp_path: Path) -> None:
    write_video(tmp_path / "video.mp4", 5)
    _sequence(tmp_path, "imDir=.\nframeRate=20\nseqLength=5\nimExt=.mp4\n")
    with open_source(str(tmp_path), warn=pytest.fail) as source:
        frames = list(iter(source.read, None))
    assert source.fps == 20.0
    assert frames[4].media_time_s == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("imDir=img1\nframeRate=fast\n", "frameRate=fast is not a number"),
        ("imDir=img1\nframeRate=25\nseqLength=-3\n", "seqLength=-3"),
        ("imDir=nowhere\nframeRate=25\n", "no pictures"),
        ("imDir=.\nframeRate=25\nimExt=.mp4\n", "0 .mp4 files"),
        ("imDir=.\nframeRate=25\nimExt=.jpg\n", "no pictures"),
        ("[broken\n", "seqinfo.ini"),
    ],
)
def test_a_broken_sequence_is_refused_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "img1").mkdir()
    _sequence(tmp_path, text)
    with pytest.raises(SourceError) as caught:
        open_source(str(tmp_path))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_cut_off_jpeg_is_unreadable(tmp_path: Path) -> None:
    noise = np.random.default_rng(3).integers(0, 255, (64, 64, 3), np.uint8)
    data = cv2.imencode(".jpg", noise)[1].tobytes()
    path = tmp_path / "a.jpg"
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(SourceError, match="not a readable picture"):
        read_picture(path)


@pytest.mark.parametrize(
    "names",
    [
        [f"2024-05-01_11-59-{s:02d}" for s in range(50, 60)]
        + [f"2024-05-01_12-00-{s:02d}" for s in range(10)],
        ["2024-05-01 11.59.59", "2024-05-01 12.00.00", "2024-05-01 12.00.30"],
        ["IMG_20240501_235958", "IMG_20240501_235959", "IMG_20240502_000000"],
        [f"take1_{n:03d}" for n in range(11, 21)] + [f"take2_{n:03d}" for n in range(1, 11)],
        ["frame_1_0.93", "frame_2_0.10", "frame_3_0.55", "frame_10_0.20"],
        ["frame_1_0.10", "frame_2_0.20", "frame_3_0.35"],
        ["1305031102.175304", "1305031102.211214", "1305031103.043227"],
        ["1403636579_763555584", "1403636579_963555584", "1403636580_163555584"],
        ["walk", "walk (1)", "walk (2)", "walk (10)"],
        ["a9", "A10", "a11", "b1"],
    ],
)  # fmt: skip
def test_names_with_times_takes_or_scores_come_in_the_order_that_a_person_means(
    names: list[str],
) -> None:
    numbered, missing = number_frames([Path(f"{name}.jpg") for name in reversed(names)])
    assert [path.stem for _, path in numbered] == names
    assert [index for index, _ in numbered] == list(range(len(names)))
    assert missing == []


@pytest.mark.parametrize(
    ("names", "indices"),
    [
        (["img_0001_640x480", "img_0002_640x480", "img_0005_640x480"], [0, 1, 4]),
        (["cam1.0001", "cam1.0002", "cam1.0004"], [0, 1, 3]),
        (["day1_0001", "day1_0002", "day2_0005"], [0, 1, 4]),
        (["00000001", "00000003"], [0, 2]),
    ],
)
def test_a_number_that_agrees_with_the_order_is_the_frame_number(
    names: list[str], indices: list[int]
) -> None:
    numbered, _ = number_frames([Path(f"{name}.jpg") for name in names])
    assert [index for index, _ in numbered] == indices


@pytest.mark.parametrize(
    "text",
    [
        "imdir = IMG1\nframerate = 14\nseqlength = 3\nimext = .png\n",
        "IMDIR=img1\nFRAMERATE=14\nSEQLENGTH=3\nIMEXT=.PNG\n",
        "imDir=img1\nframeRate=14\nseqLength=3\nimExt=png\n",
        "imDir=img1\nframeRate=14\nseqLength=3\n",
    ],
)
@pytest.mark.parametrize(
    ("file", "folder", "pattern"),
    [("seqinfo.ini", "img1", "{:06d}.png"), ("SEQINFO.INI", "Img1", "{:08d}.PNG")],
)
def test_a_sequence_file_counts_large_and_small_letters_alike(
    tmp_path: Path, text: str, file: str, folder: str, pattern: str
) -> None:
    write_folder(tmp_path / folder, [1, 2, 3], pattern)
    (tmp_path / file).write_text("[sequence]\nname=s\n" + text)
    with open_source(str(tmp_path), warn=pytest.fail) as source:
        assert (source.fps, source.frame_count) == (14.0, 3)
        assert [frame.index for frame in iter(source.read, None)] == [0, 1, 2]


@pytest.mark.parametrize("pattern", ["{:06d}.png", "{:08d}.PNG", "frame{}.png"])
def test_pictures_are_found_by_the_frame_numbers_of_ground_truth(
    tmp_path: Path, pattern: str
) -> None:
    write_folder(tmp_path, [2, 3, 10], pattern)
    read = pictures_by_number(tmp_path)
    assert [index_of(read(number)) for number in (2, 3, 3, 10)] == [2, 3, 3, 10]
    with pytest.raises(SourceError, match="no picture of frame 11"):
        read(11)


def test_a_video_is_read_by_frame_numbers_as_well(tmp_path: Path) -> None:
    read = pictures_by_number(write_video(tmp_path / "v.mp4", 5))
    assert [index_of(read(number)) for number in (1, 4)] == [0, 3]


@pytest.mark.parametrize(("low", "high"), [(0, 4095), (29_000, 31_000), (500, 800)])
def test_sixteen_bits_of_which_few_are_used_are_stretched_alike_in_all_pictures(
    tmp_path: Path, low: int, high: int
) -> None:
    ramp = np.linspace(low, high, 64 * 48).reshape(48, 64).astype(np.uint16)
    write_picture(tmp_path / "1.png", ramp)
    write_picture(tmp_path / "2.png", np.full_like(ramp, (low + high) // 2))
    warnings: list[str] = []
    with open_source(str(tmp_path), warn=warnings.append) as source:
        first, second = (frame.image for frame in iter(source.read, None))
    assert np.ptp(first) > 150
    assert abs(int(second[0, 0, 0]) - int(np.median(first))) < 5
    assert "stretched" in warnings[0]


def test_sixteen_bits_in_full_use_keep_their_upper_eight() -> None:
    ramp = np.linspace(0, 65535, 64 * 48).reshape(48, 64).astype(np.uint16)
    stretch = Stretch()
    assert np.array_equal(stretch.to_8bit(ramp), (ramp >> 8).astype(np.uint8))
    assert stretch.used is None


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".tif", ".webp", ".ppm"])
def test_the_size_of_a_picture_is_read_from_its_header(tmp_path: Path, suffix: str) -> None:
    path = write_picture(tmp_path / f"a{suffix}", picture(2, 70, 50))
    assert picture_size(path.read_bytes()) == (70, 50)
    assert picture_size(path.read_bytes()[:3]) is None


@pytest.mark.parametrize(
    ("size", "words"), [((30_000, 30_000), "30000x30000 pixels"), ((20_000, 8), "20000x8 pixels")]
)
def test_a_picture_beyond_8k_is_refused_before_it_is_decoded(
    tmp_path: Path, size: tuple[int, int], words: str
) -> None:
    """A PNG of 109 kB can unpack to 5 GB."""
    data = bytearray(cv2.imencode(".png", np.zeros((8, 8), np.uint8))[1].tobytes())
    data[16:24] = size[0].to_bytes(4, "big") + size[1].to_bytes(4, "big")
    data[29:33] = zlib.crc32(data[12:29]).to_bytes(4, "big")
    (tmp_path / "1.png").write_bytes(data)
    with pytest.raises(SourceError, match=words) as caught:
        open_source(str(tmp_path), warn=lambda _: None)
    assert "\n" not in str(caught.value)


def test_a_folder_that_holds_a_video_says_to_give_the_video(tmp_path: Path) -> None:
    write_video(tmp_path / "walk.mp4", 2)
    with pytest.raises(SourceError, match=r"give .*walk\.mp4 itself"):
        open_source(str(tmp_path))


def test_a_folder_whose_name_is_not_utf8_can_be_named_in_a_message(tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"\xe9t\xe9")
    write_folder(tmp_path / "plain", [1, 2]).rename(folder)
    with open_source(str(folder)) as source:
        assert source.name.encode().endswith(rb"\xe9t\xe9")
        assert len(list(iter(source.read, None))) == 2
