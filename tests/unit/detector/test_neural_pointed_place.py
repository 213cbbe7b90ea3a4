"""Where a user points and the network has seen nobody, it looks more closely for a while."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from heel.schemas import FrameId, Pointed
from heel.services.detector.core import Detector
from heel.services.detector.interface import Frame
from heel.services.detector.neural.pointed_place import PointedPlace
from heel.services.detector.neural.views import Expected
from heel.services.detector.settings import DetectorSettings
from heel.services.geometry.boxes import height, holds
from heel.services.geometry.picture_motion import CameraPath
from tests.unit.detector.drawn_scene import frame_id
from tests.unit.networks.drawn_networks import picture, red_finder

SIZE = (320, 240)
AT = (100.0, 120.0)


def pointed(seq: int, x_px: float, y_px: float, **other: object) -> Pointed:
    frame = frame_id(seq).model_dump() | other
    return Pointed(
        frame=FrameId.model_validate(frame), width=SIZE[0], height=SIZE[1], x_px=x_px, y_px=y_px
    )


def frame(seq: int, point: Pointed | None = None) -> Frame:
    return Frame(frame_id(seq), np.zeros((SIZE[1], SIZE[0], 3), np.uint8), SIZE, None, point)


def path_of(*steps: np.ndarray) -> CameraPath:
    path = CameraPath()
    for seq, step in enumerate(steps):
        path.add(seq, step)
    return path


def test_people_of_several_sizes_are_expected_where_somebody_pointed() -> None:
    place, path = PointedPlace(), path_of(np.eye(2, 3))
    assert place.expected(frame(0), path, []) == []
    found = place.expected(frame(0, pointed(0, *AT)), path, [])
    found += [one for seq in (1, 2) for one in place.expected(frame(seq), path, [])]
    assert [one.track_id for one in found] == [None] * 3
    assert all(holds(one.box_xyxy, AT) for one in found)
    assert sorted(height(one.box_xyxy) / SIZE[1] for one in found) == pytest.approx(
        [0.1, 0.2, 0.35]
    )


def test_the_place_goes_with_the_picture_from_the_frame_that_was_pointed_at() -> None:
    right = np.array([[1.0, 0.0, 20.0], [0.0, 1.0, 0.0]])
    place, path = PointedPlace(), path_of(np.eye(2, 3), np.eye(2, 3), right, right)
    found = place.expected(frame(3, pointed(1, *AT)), path, [])
    assert [holds(one.box_xyxy, (AT[0] + 40, AT[1])) for one in found] == [True]
    path.add(4, right)
    found = place.expected(frame(4), path, [])
    assert [holds(one.box_xyxy, (AT[0] + 60, AT[1])) for one in found] == [True]


def test_nobody_is_expected_beside_who_is_there_nor_for_ever_nor_in_other_pictures() -> None:
    place, path = PointedPlace(), path_of(np.eye(2, 3))
    known = [Expected((90.0, 80.0, 130.0, 180.0), 7)]
    assert place.expected(frame(0, pointed(0, *AT)), path, known) == []
    assert len(place.expected(frame(1), path, [])) == 1
    late = next(seq for seq in range(1, 10_000) if frame_id(seq).t_capture_ns > 5.1e9)
    assert place.expected(frame(late), path, []) == []
    assert place.expected(frame(1), path, []) == [], "the place is forgotten"
    assert place.expected(frame(2, pointed(2, *AT, epoch=9)), path, []) == []


def test_who_is_too_small_for_the_whole_frame_is_found_where_a_user_points(tmp_path: Path) -> None:
    small = picture(*SIZE, (60, 70, 20, 20))
    settings = DetectorSettings(model=red_finder(tmp_path / "net.onnx"), model_closer_looks=1)
    untold, told = Detector(settings), Detector(settings)
    for seq in range(3):  # before a search, tile by tile, has come there
        point = pointed(0, 70, 80) if seq == 0 else None
        nobody = untold.detect(frame_id(seq), small, SIZE, None)
        found = told.detect(frame_id(seq), small, SIZE, None, point)
        if found.blobs:
            break
    assert nobody.blobs == ()
    assert {holds(blob.box_xyxy, (70, 80)) for blob in found.blobs} == {True}
