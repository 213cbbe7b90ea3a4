"""The timeline tells what was scored, and both pictures are written."""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from heel.evaluation.alignment import AlignedSequence, align
from heel.evaluation.plots import runs, write_plots
from heel.evaluation.timeline import ABSENT, MISSED, timeline
from heel.evaluation.tracking_scores import tracking_scores
from heel.schemas.errors import HeelError
from tests.support.box_rows import rows_from_array

Rows = NDArray[np.float64]
Draw = Callable[[int], tuple[Rows, Rows]]

BOX = [10, 10, 20, 40]


def sequence(truth: Rows, tracks: Rows, name: str = "drawn") -> AlignedSequence:
    return align(
        rows_from_array(truth, "ground truth"), rows_from_array(tracks, "tracks"), name=name
    )


def width_and_height(png: Path) -> tuple[int, int]:
    header = png.read_bytes()[:24]
    assert header[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", header[16:])
    return width, height


def test_timeline_knows_tracked_missed_absent_and_switched() -> None:
    truth = np.array([[frame, 1, *BOX, 1] for frame in (1, 2, 3, 5)])
    tracks = np.array([[1, 7, *BOX, 1], [3, 9, *BOX, 1], [6, 9, *BOX, 1]])
    table = timeline(sequence(truth, tracks))
    assert table.tracks.tolist() == [[0, MISSED, 1, ABSENT, MISSED, ABSENT]]
    assert np.flatnonzero(table.switches).tolist() == [2]


@pytest.mark.parametrize("between", [[], [[2, 1, *BOX, 1]]], ids=["nobody there", "nobody shown"])
def test_pair_survives_a_frame_without_outputs_as_in_trackeval(between: list[list[float]]) -> None:
    truth = np.array([[1, 1, *BOX, 1], *between, [3, 1, *BOX, 1]])
    tracks = np.array([[1, 7, *BOX, 1], [3, 7, 14, 10, 20, 40, 1], [3, 8, *BOX, 1]])
    drawn = sequence(truth, tracks)
    assert timeline(drawn).switches.sum() == tracking_scores(drawn).idsw == 0


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("threshold", [0.3, 0.5])
def test_marks_in_the_timeline_are_the_switches_that_are_scored(
    draw_sequence: Draw, seed: int, threshold: float
) -> None:
    drawn = sequence(*draw_sequence(seed))
    table, scores = timeline(drawn, threshold), tracking_scores(drawn, threshold)
    assert int(table.switches.sum()) == scores.idsw > 0
    assert int((table.tracks == MISSED).sum()) == scores.fn
    assert int((table.tracks != ABSENT).sum()) == scores.boxes


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([], []),
        ([4], [(0, 1, 4)]),
        ([4, 4, -1, -1, -1, 4], [(0, 2, 4), (2, 5, -1), (5, 6, 4)]),
    ],
)
def test_runs_are_stretches_of_equal_numbers(
    values: list[int], expected: list[tuple[int, int, int]]
) -> None:
    assert runs(np.array(values, dtype=np.int64)) == expected


def test_both_pictures_are_written_beside_each_other(draw_sequence: Draw, tmp_path: Path) -> None:
    files = write_plots(sequence(*draw_sequence(1)), tmp_path / "new" / "folder")
    assert [file.name for file in files] == ["drawn-accuracy.png", "drawn-timeline.png"]
    for file in files:
        assert width_and_height(file)[0] == 1650


def test_more_people_make_a_taller_timeline(tmp_path: Path) -> None:
    heights = []
    for people in (3, 30):
        truth = np.array([[1, person, 50 * person, 10, 20, 40, 1] for person in range(people)])
        _, file = write_plots(sequence(truth, truth, f"{people}-people"), tmp_path)
        heights.append(width_and_height(file)[1])
    assert heights[1] > 3 * heights[0]


@pytest.mark.parametrize("tracks", [np.empty((0, 7)), np.array([[1, 7, *BOX, 1]])])
def test_one_frame_and_no_tracks_can_be_drawn(tracks: Rows, tmp_path: Path) -> None:
    files = write_plots(sequence(np.array([[1, 1, *BOX, 1]]), tracks), tmp_path)
    assert all(width_and_height(file) for file in files)


def test_a_name_cannot_leave_the_folder(tmp_path: Path) -> None:
    truth = np.array([[1, 1, *BOX, 1]])
    files = write_plots(sequence(truth, truth, "../../up and away"), tmp_path)
    assert {file.parent for file in files} == {tmp_path}


def test_unwritable_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    truth = np.array([[1, 1, *BOX, 1]])
    with pytest.raises(HeelError, match="taken: cannot be written"):
        write_plots(sequence(truth, truth), tmp_path / "taken")


def test_missing_matplotlib_is_told_with_the_command_to_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("matplotlib.figure", "matplotlib.backends.backend_agg"):
        monkeypatch.setitem(sys.modules, name, None)
    truth = np.array([[1, 1, *BOX, 1]])
    with pytest.raises(HeelError, match="pip install matplotlib"):
        write_plots(sequence(truth, truth), tmp_path)


def test_plotting_opens_no_window_system(draw_sequence: Draw, tmp_path: Path) -> None:
    before = "matplotlib.pyplot" in sys.modules
    write_plots(sequence(*draw_sequence(2)), tmp_path)
    assert ("matplotlib.pyplot" in sys.modules) == before
