"""The scripted window of a recording: where it goes, who counts, and what a run is scored by."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.scripted_pan import row
from heel.schemas import FrameId, Track, Tracks
from heel.services.detector.settings import DetectorSettings
from heel.services.loops.panning.perception import Pixels, TrueBoxes
from heel.services.loops.panning.scripted import (
    boxes_shown,
    counted,
    following,
    panning,
    play,
    scripted_frames,
)
from heel.services.loops.panning.truth import InWindow, TruePeople

DATA = Path(os.environ.get("HEEL_DATA", Path(__file__).parents[4] / "shared" / "data"))
RECORDING, WINDOW = (400, 300), (200, 150)


def at(*people: tuple[int, float, float]) -> TruePeople:
    """People of 20x50 pixels with the middle at x, y."""
    boxes = [(x - 10, y - 25, x + 10, y + 25) for _, x, y in people]
    return TruePeople(
        np.array([who for who, _, _ in people]), np.array(boxes, float).reshape(-1, 4)
    )


def recording(folder: Path, frames: int = 12) -> Path:
    """A sequence of a textured wall with one person who walks right."""
    (folder / "img1").mkdir(parents=True)
    (folder / "gt").mkdir()
    wall = np.random.default_rng(0).integers(60, 200, (*RECORDING[::-1], 3)).astype(np.uint8)
    rows = []
    for index in range(frames):
        image, left = wall.copy(), 180 + 4 * index
        image[120:170, left : left + 20] = (20, 30, 220)
        assert cv2.imwrite(str(folder / "img1" / f"{index + 1:06d}.png"), image)
        rows.append(f"{index + 1},7,{left + 1},121,20,50,1,-1,-1,-1\n")
    (folder / "gt" / "gt.txt").write_text("".join(rows))
    (folder / "seqinfo.ini").write_text(
        f"[Sequence]\nname=made\nimDir=img1\nframeRate=10\nseqLength={frames}\n"
        f"imWidth={RECORDING[0]}\nimHeight={RECORDING[1]}\nimExt=.png\n"
    )
    return folder


def test_following_goes_a_share_of_the_way_and_never_faster_than_8_pixels() -> None:
    people = {frame: at((1, 260.0, 150.0)) for frame in range(1, 41)}
    path = following(people, 40, RECORDING, WINDOW)
    assert path[0].tolist() == [208.0, 150.0]
    steps = np.hypot(*np.diff(path, axis=0).T)
    assert steps.max() == pytest.approx(0.15 * 52)
    assert path[-1].tolist() == pytest.approx([260.0, 150.0], abs=0.5)


def test_following_stays_with_one_person_and_takes_whoever_stays_longest_after() -> None:
    people = {frame: at((1, 150.0, 100.0), (2, 250.0, 200.0)) for frame in range(1, 41)}
    people |= {frame: at((2, 250.0, 200.0), (3, 150.0, 150.0)) for frame in range(41, 81)}
    people |= {frame: at((3, 150.0, 150.0)) for frame in range(81, 121)}
    path = following(people, 120, RECORDING, WINDOW)
    assert path[79].tolist() == pytest.approx([250.0, 200.0], abs=0.5)
    assert path[119].tolist() == pytest.approx([150.0, 150.0], abs=0.5)


def test_following_waits_where_nobody_is_and_stays_in_the_recording() -> None:
    path = following({1: at((1, 390.0, 20.0)), 60: at((1, 390.0, 20.0))}, 60, RECORDING, WINDOW)
    assert (path[:59] == path[0]).all()
    people = {frame: at((1, 390.0, 20.0)) for frame in range(1, 61)}
    assert following(people, 60, RECORDING, WINDOW)[-1].tolist() == [300.0, 75.0]


def test_panning_goes_from_border_to_border() -> None:
    path = panning({}, 465, RECORDING, WINDOW)
    assert path[0].tolist() == [200.0, 150.0]
    assert path[116, 0] == pytest.approx(300.0)
    assert path[348, 0] == pytest.approx(100.0)
    assert 75.0 < path[:, 1].min() < path[:, 1].max() < 225.0


@pytest.mark.parametrize(("inside", "counts"), [(0.59, []), (0.6, [4]), (1.0, [4])])
def test_people_count_from_60_percent_inside(inside: float, counts: list[int]) -> None:
    seen = InWindow(np.array([4]), np.array([[0.0, 0.0, 12.0, 50.0]]), np.array([inside]))
    assert counted(seen)[0] == counts


def test_shown_boxes_are_cut_at_the_window_and_none_remains_without_area() -> None:
    frame = FrameId(stream="front", epoch=1, seq=0, index=0, t_capture_ns=0)

    def track(number: int, left: float, shown: bool = True) -> Track:
        return Track(
            id=number, state="tracked", box_xyxy=(left, 10.0, left + 20.0, 60.0), area_px=1000.0,
            velocity_pxps=(0.0, 0.0), span_px=1.0, identity_confidence=1.0, shown=shown,
        )  # fmt: skip

    tracks = Tracks(
        **frame.model_dump(), width=200, height=150, source_width=200, source_height=150,
        tracks=(track(1, -8.0), track(2, 90.0, shown=False), track(3, 205.0)),
    )  # fmt: skip
    identities, boxes = boxes_shown(tracks, WINDOW)
    assert identities == [1]
    assert boxes.tolist() == [[0.0, 10.0, 12.0, 60.0]]


def test_a_seed_gives_the_same_pictures_and_another_one_others(tmp_path: Path) -> None:
    folder = recording(tmp_path / "made", frames=3)

    def pictures(seed: int) -> list[NDArray[np.uint8]]:
        return [frame.image for frame in scripted_frames(folder, WINDOW, panning, seed)]

    assert len(pictures(1)) == 3
    assert all(np.array_equal(a, b) for a, b in zip(pictures(1), pictures(1), strict=True))
    assert not np.array_equal(pictures(1)[0], pictures(2)[0])


def test_the_truth_of_a_frame_lies_where_its_window_shows_the_person(tmp_path: Path) -> None:
    for frame in scripted_frames(recording(tmp_path / "made"), WINDOW, following):
        left, top, right, bottom = np.round(frame.truth.boxes_xyxy[0]).astype(int)
        inside = frame.image[top + 3 : bottom - 3, left + 3 : right - 3].astype(float)
        assert inside.mean(axis=(0, 1)).tolist() == pytest.approx([20.0, 30.0, 220.0], abs=3.0)


def test_whoever_is_seen_as_they_are_scores_all_but_the_first_frames(tmp_path: Path) -> None:
    played = play(recording(tmp_path / "made"), WINDOW, following, TrueBoxes())
    assert played.scores.boxes == 12
    assert played.scores.fp == played.scores.idsw == 0
    assert played.scores.fn <= 2
    assert len(played.shifts_px) == 11
    line = row("follows a person", "true-boxes", [played, played])
    assert line.startswith(f"| follows a person | {played.shifts_px.mean():.1f}, at most ")
    assert f"| true-boxes | 2 | {played.scores.mota:.1f} | {played.scores.mota:.1f} |" in line


@pytest.mark.slow
def test_the_carried_background_sees_people_from_a_window_that_follows_one() -> None:
    if not (DATA / "PETS09-S2L1").is_dir():
        pytest.skip(f"no recordings in {DATA}: set HEEL_DATA")
    pixels = Pixels(DetectorSettings(detector="ego"))
    assert play(DATA / "PETS09-S2L1", (384, 288), following, pixels, 3).scores.mota >= 75.0
