"""Reading and writing MOTChallenge files, and what a user is told about broken ones."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from heel.evaluation.motchallenge import (
    SequenceInfo,
    format_track_row,
    ground_truth_file,
    read_detections,
    read_ground_truth,
    read_sequence_info,
    read_tracks,
    write_tracks,
)
from heel.evaluation.plausible import check_size, warn_of_another_size
from heel.evaluation.rows import BoxRows, rows_from_xyxy
from heel.schemas.errors import HeelError
from tests.support.box_rows import rows_from_array

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


def two_walkers(row: str) -> str:
    """Rows of two people in 40 frames, made by a format of f, i, x, y, w, h."""
    people = ((1, 100, 4, 100, 40, 100), (2, 400, -3, 110, 42, 104))
    return "".join(
        row.format(f=f, i=i, x=x + v * f, y=y, w=w, h=h, r=x + v * f + w, b=y + h) + "\n"
        for f in range(1, 41)
        for i, x, v, y, w, h in people
    )


def with_classes(first: int, second: int, row: str = "{f},{i},{x},{y},{w},{h},1,{{}},1") -> str:
    lines = two_walkers(row).splitlines()
    return "".join(
        line.format((first, second)[number % 2]) + "\n" for number, line in enumerate(lines)
    )


@pytest.mark.parametrize("other", [3, 6, 9, 13])
def test_of_ground_truth_with_classes_only_people_are_read(
    file: Callable[[str], Path], other: int, caplog: pytest.LogCaptureFixture
) -> None:
    rows = read_ground_truth(file(with_classes(1, other)))
    assert set(rows.identities.tolist()) == {1}
    assert "40 of 80 rows are of other classes" in caplog.text


@pytest.mark.parametrize("other", [2, 7, 8, 12])
def test_people_whom_the_protocol_does_not_score_get_flag_0(
    file: Callable[[str], Path], other: int
) -> None:
    rows = read_ground_truth(file(with_classes(1, other)))
    assert len(rows) == 80
    assert set(rows.values[rows.identities == 2].tolist()) == {0.0}
    assert set(rows.values[rows.identities == 1].tolist()) == {1.0}


@pytest.mark.parametrize("columns", ["1,{{}},0.5", "0.9,{{}}", "0.9,{{}},-1"])
def test_detections_with_classes_are_of_people_only(
    file: Callable[[str], Path], columns: str
) -> None:
    rows = read_detections(file(with_classes(1, 3, "{f},-1,{x},{y},{w},{h}," + columns)))
    assert len(rows) == 40
    assert rows.boxes_xyxy[0, 0] == 103


@pytest.mark.parametrize("code", [-1, 0, 1])
def test_one_class_alone_is_people(file: Callable[[str], Path], code: int) -> None:
    assert len(read_ground_truth(file(with_classes(code, code)))) == 80


@pytest.mark.parametrize("columns", ["-1,-1,-1", "0.3,-2.5,1.7", "3.5,4.25,0", "-1,-1,-1,"])
def test_places_in_the_world_are_no_classes(file: Callable[[str], Path], columns: str) -> None:
    assert len(read_ground_truth(file(two_walkers("{f},{i},{x},{y},{w},{h},1," + columns)))) == 80


def test_categories_of_visdrone_are_known(file: Callable[[str], Path]) -> None:
    row = "{f},{i},{x},{y},{w},{h},1,{{}},0,2"
    assert len(read_ground_truth(file(with_classes(1, 4, row)))) == 40
    assert len(read_ground_truth(file(with_classes(1, 2, row)))) == 80


@pytest.mark.parametrize(
    ("first", "second", "told"),
    [
        (0, 2, r"line 1: class 0 in column 8 \(there are 0, 2\) is none of MOTChallenge's"),
        (1, 80, r"line 2: class 80 in column 8"),
        (3, 3, r"line 1: class 3 in column 8, and no row is of class 1, a pedestrian"),
    ],
)
def test_classes_that_nothing_explains_are_refused(
    file: Callable[[str], Path], first: int, second: int, told: str
) -> None:
    with pytest.raises(HeelError, match=told):
        read_ground_truth(file(with_classes(first, second)))


@pytest.mark.parametrize("read", [read_ground_truth, read_detections, read_tracks])
def test_boxes_as_shares_of_the_picture_are_refused(
    file: Callable[[str], Path], read: Callable[[Path], BoxRows]
) -> None:
    path = file("1,1,0.2,0.3,0.05,0.2,0.9\n2,1,0.21,0.3,0.05,0.2,0.9\n")
    with pytest.raises(HeelError, match=r"line 1: box 0\.2,0\.3,0\.05,0\.2: .*0 to 1.*in pixels"):
        read(path)


@pytest.mark.parametrize("read", [read_ground_truth, read_detections, read_tracks])
def test_a_mistyped_frame_number_is_refused_with_its_line(
    file: Callable[[str], Path], read: Callable[[Path], BoxRows]
) -> None:
    path = file(GOOD + "9000000,1,10,20,30,40,1\n" + GOOD.replace("1,1", "3,1", 1))
    with pytest.raises(HeelError, match="line 2: frame 9000000 after nobody since frame 3"):
        read(path)


def test_corners_in_place_of_sizes_are_told_of(
    file: Callable[[str], Path], caplog: pytest.LogCaptureFixture
) -> None:
    corners = file(two_walkers("{f},-1,{x},{y},{r},{b},0.9"))
    rows = read_detections(corners)
    with pytest.raises(HeelError, match=r"look like left,top,right,bottom: write width and height"):
        check_size(rows, (640, 480), str(corners))
    read_detections(file(two_walkers("{f},-1,{x},{x},{r},{r},0.9")))
    assert "look like left,top,right,bottom" in caplog.text
    caplog.clear()
    sizes = file(two_walkers("{f},-1,{x},{y},{w},{h},0.9"))
    check_size(read_detections(sizes), (640, 480), str(sizes))
    assert caplog.text == ""


def test_boxes_of_larger_pictures_are_refused_where_the_size_is_known(
    file: Callable[[str], Path],
) -> None:
    path = file(two_walkers("{f},-1,{x},{y},{w},{h},0.9"))
    with pytest.raises(HeelError, match="outside of pictures of 213x160"):
        check_size(read_detections(path), (213, 160), str(path))


def test_tracks_of_smaller_pictures_are_told_of(
    file: Callable[[str], Path], caplog: pytest.LogCaptureFixture
) -> None:
    truth = read_ground_truth(file(two_walkers("{f},{i},{x},{y},{w},{h},1")))
    small = rows_from_xyxy(truth.frames, truth.identities, truth.boxes_xyxy / 3)
    warn_of_another_size(truth, small, "tracks.txt")
    assert "made on pictures of the same size?" in caplog.text
    caplog.clear()
    warn_of_another_size(truth, truth, "tracks.txt")
    assert caplog.text == ""
