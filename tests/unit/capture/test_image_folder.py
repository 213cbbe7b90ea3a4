"""Folders of pictures: order, gaps, odd formats, unreadable files, MOTChallenge layout."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from schemas.errors import SourceError
from services.capture.image_folder import decode_picture, number_frames
from services.capture.sources import open_source
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
    decoded = decode_picture(write_picture(tmp_path / "a.png", image))
    assert decoded is not None
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
    assert decode_picture(path) is None
