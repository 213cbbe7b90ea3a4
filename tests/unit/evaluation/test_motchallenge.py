"""Reading and writing MOTChallenge files, and what a user is told about broken ones."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evaluation.motchallenge import (
    SequenceInfo,
    format_track_row,
    ground_truth_file,
    read_detections,
    read_ground_truth,
    read_sequence_info,
    read_tracks,
    write_tracks,
)
from evaluation.rows import BoxRows, rows_from_array, rows_from_xyxy
from schemas.errors import HeelError

GOOD = "1,1,10,20,30,40,1,-1,-1,-1\n"


@pytest.fixture
def file(tmp_path: Path) -> Callable[[str], Path]:
    def write(text: str) -> Path:
        path = tmp_path / "rows.txt"
        path.write_bytes(text.encode())
        return path

    return write


def test_file_pixels_count_from_one_and_boxes_from_zero(file: Callable[[str], Path]) -> None:
    rows = read_ground_truth(file("3,7,1,1,768,576,0,-1,-1,-1\n"))
    assert rows.frames.tolist() == [3]
    assert rows.identities.tolist() == [7]
    assert rows.boxes_xyxy.tolist() == [[0, 0, 768, 576]]
    assert rows.values.tolist() == [0]


def test_written_rows_are_motchallenge_rows() -> None:
    row = format_track_row(5, 2, (0.0, 10.5, 30.0, 99.25), 0.75)
    assert row == "5,2,1.000,11.500,30.000,88.750,0.750,-1,-1,-1"


def test_writing_and_reading_gives_the_same_rows(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    corner = rng.uniform(-50, 700, (40, 2)).round(3)
    boxes = np.hstack([corner, corner + rng.uniform(5, 90, (40, 2)).round(3)])
    rows = rows_from_xyxy(np.repeat(range(1, 11), 4), np.tile(range(4), 10), boxes, rng.random(40))
    write_tracks(tmp_path / "tracks.txt", rows)
    again = read_tracks(tmp_path / "tracks.txt")
    assert again.frames.tolist() == rows.frames.tolist()
    assert again.identities.tolist() == rows.identities.tolist()
    np.testing.assert_allclose(again.boxes_xyxy, rows.boxes_xyxy, atol=0.002)
    np.testing.assert_allclose(again.values, rows.values, atol=0.001)


def test_rows_are_sorted_by_frame_and_identity(file: Callable[[str], Path]) -> None:
    rows = read_tracks(file("2,1,1,1,9,9,1\n1,5,1,1,9,9,1\n1,3,1,1,9,9,1\n"))
    assert list(zip(rows.frames, rows.identities, strict=True)) == [(1, 3), (1, 5), (2, 1)]


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("\ufeff" + GOOD, id="byte order mark"),
        pytest.param(GOOD.replace("\n", "\r\n"), id="carriage returns"),
        pytest.param("\n" + GOOD + "  \n\n", id="blank lines"),
        pytest.param("1.0,1.0, 10.0 , 20,3e1,40,1\n", id="floats and spaces"),
    ],
)
def test_harmless_differences_are_accepted(file: Callable[[str], Path], text: str) -> None:
    assert read_ground_truth(file(text)).boxes_xyxy.tolist() == [[9, 19, 39, 59]]


@pytest.mark.parametrize(
    ("row", "told"),
    [
        pytest.param("1,1,10,20,30", "5 columns", id="too few columns"),
        pytest.param("1 2 10 20 30 40 1", "with commas", id="no commas"),
        pytest.param("2,1,10,x20,30,40,1", "'x20'", id="not a number"),
        pytest.param("2,1,10,,30,40,1", "could not convert", id="empty field"),
        pytest.param("2,1,10,20,nan,40,1", "nan is not finite", id="nan"),
        pytest.param("2,1,10,20,30,40,inf", "inf is not finite", id="infinite flag"),
        pytest.param("0,1,10,20,30,40,1", "0 is not a frame number", id="frame 0"),
        pytest.param("2.5,1,10,20,30,40,1", "2.5 is not a frame number", id="half a frame"),
        pytest.param("1e12,1,10,20,30,40,1", "1000000000000 is not", id="absurd frame"),
        pytest.param("2,-1,10,20,30,40,1", "-1 is not an identity", id="no identity"),
        pytest.param("2,1.5,10,20,30,40,1", "1.5 is not an identity", id="half an identity"),
        pytest.param("2,1,10,20,0,40,1", "0 is not a size", id="no width"),
        pytest.param("2,1,10,20,30,-4,1", "-4 is not a size", id="negative height"),
        pytest.param("2,1,1e9,20,30,40,1", "1000000000 is not in pixels", id="absurd pixels"),
        pytest.param("1,1,11,20,30,40,1", "identity 1 is in frame 1 twice", id="duplicate"),
    ],
)
@pytest.mark.parametrize("read", [read_ground_truth, read_tracks])
def test_malformed_row_is_named_with_file_line_and_value(
    file: Callable[[str], Path], read: Callable[[Path], BoxRows], row: str, told: str
) -> None:
    path = file(GOOD + "\n" + row + "\n")
    with pytest.raises(HeelError) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}: line 3: ")
    assert told in str(caught.value)


def test_ground_truth_without_flags_is_refused(file: Callable[[str], Path]) -> None:
    with pytest.raises(HeelError, match=r"6 columns.*7 needed"):
        read_ground_truth(file("1,1,10,20,30,40\n"))


def test_tracks_without_confidence_are_certain(file: Callable[[str], Path]) -> None:
    assert read_tracks(file("1,1,10,20,30,40\n")).values.tolist() == [1.0]


def test_detections_have_no_identity_whatever_the_file_says(file: Callable[[str], Path]) -> None:
    rows = read_detections(file("1,-1,10,20,30,40,0.9\n1,7,50,20,30,40,0.8\n"))
    assert rows.identities.tolist() == [-1, -1]
    assert rows.values.tolist() == [0.9, 0.8]


@pytest.mark.parametrize("read", [read_ground_truth, read_detections])
@pytest.mark.parametrize("text", ["", "\n \n"])
def test_empty_input_file_is_refused(
    file: Callable[[str], Path], read: Callable[[Path], BoxRows], text: str
) -> None:
    with pytest.raises(HeelError, match="empty"):
        read(file(text))


def test_empty_tracks_file_means_that_nobody_was_shown(file: Callable[[str], Path]) -> None:
    assert len(read_tracks(file(""))) == 0


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(HeelError, match=r"nowhere\.txt: cannot be read \(No such file"):
        read_tracks(tmp_path / "nowhere.txt")


def test_binary_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "video.mp4").write_bytes(b"\x00\xff\xfe\x80" * 20)
    with pytest.raises(HeelError, match="not a text file"):
        read_tracks(tmp_path / "video.mp4")


def test_ground_truth_is_a_sequence_directory_or_the_file(tmp_path: Path) -> None:
    (tmp_path / "gt").mkdir()
    gt = tmp_path / "gt" / "gt.txt"
    gt.write_text(GOOD)
    assert ground_truth_file(tmp_path) == gt
    assert ground_truth_file(gt) == gt
    with pytest.raises(HeelError, match=r"holds gt/gt\.txt"):
        ground_truth_file(tmp_path / "gt")


@pytest.mark.parametrize(
    ("frame", "box", "confidence", "told"),
    [
        (1, (0, 0, float("nan"), 9), 1.0, "not finite"),
        (1, (0, 0, 9, 9), float("inf"), "not finite"),
        (1, (5, 0, 5, 9), 1.0, "not a size"),
        (1, (5, 0, 5.0004, 9), 1.0, "not a size"),
        (0, (0, 0, 9, 9), 1.0, "not a frame number"),
    ],
)
def test_what_cannot_be_read_back_is_not_written(
    frame: int, box: tuple[float, ...], confidence: float, told: str
) -> None:
    with pytest.raises(HeelError, match=told):
        format_track_row(frame, 1, box, confidence)


def test_array_rows_are_checked_like_file_rows_and_left_alone() -> None:
    given = np.array([[1, -1, 1, 1, 9, 9, 1.0]])
    with pytest.raises(HeelError, match="tracks: row 1: -1 is not an identity"):
        rows_from_array(given, "tracks")
    rows_from_array(given, "detections")
    assert given.tolist() == [[1, -1, 1, 1, 9, 9, 1]]


@pytest.mark.parametrize("shape", [(3, 5), (7,)])
def test_array_of_another_shape_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(HeelError, match="give \\(N, 7\\)"):
        rows_from_array(np.ones(shape), "tracks")


def test_sequence_info_reads_the_ini_beside_the_frames(tmp_path: Path) -> None:
    (tmp_path / "seqinfo.ini").write_text(
        "[Sequence]\nname=walk\nframeRate=7\nseqLength=795\nimWidth=768\nimHeight=576\n"
    )
    expected = SequenceInfo("walk", 795, 7.0, 768, 576)
    assert read_sequence_info(tmp_path) == expected
    assert read_sequence_info(tmp_path / "seqinfo.ini") == expected


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("name=walk\n", "Sequence"),
        ("[Other]\nseqLength=5\n", "Sequence"),
        ("[Sequence]\nname=walk\n", "seqLength is missing"),
        ("[Sequence]\nseqLength=many\n", "seqLength = many"),
        ("[Sequence]\nseqLength=0\n", "seqLength = 0"),
        ("[Sequence]\nseqLength=9\nframeRate=nan\n", "frameRate = nan"),
    ],
)
def test_broken_sequence_info_is_named(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "seqinfo.ini").write_text(text)
    with pytest.raises(HeelError, match=told):
        read_sequence_info(tmp_path)
