"""A picture and its small copy on one sheet: where they lie, and whose boxes count."""

from __future__ import annotations

import numpy as np
import pytest

from heel.services.networks.person_model import PAD_GREY, Sheet

INPUT = (416, 416)
NOBODY = (np.zeros((0, 4), np.float32), np.zeros(0, np.float32))


def box(left: float, top: float, right: float, bottom: float) -> np.ndarray:
    return np.array([[left, top, right, bottom]], np.float32)


@pytest.mark.parametrize(
    ("picture", "copy"),
    [
        pytest.param((640, 480), (0, 320, 128, 96), id="wide: below"),
        pytest.param((1920, 1080), (0, 242, 309, 174), id="wider: below"),
        pytest.param((480, 640), (320, 0, 96, 128), id="high: beside"),
        pytest.param((416, 416), None, id="of the input's form: no room"),
        pytest.param((640, 560), None, id="nearly of its form: too little room"),
    ],
)
def test_the_copy_lies_in_the_room_that_is_left(
    picture: tuple[int, int], copy: tuple[int, int, int, int] | None
) -> None:
    white = np.full((picture[1], picture[0], 3), 255, np.uint8)
    sheet = Sheet(INPUT, picture).lay_out(white)
    assert sheet.shape == (416, 416, 3)
    rest = sheet[:, :, 0].copy()
    scale = min(416 / picture[0], 416 / picture[1])
    rest[: round(picture[1] * scale), : round(picture[0] * scale)] = PAD_GREY
    rows, columns = np.nonzero(rest == 255)
    if copy is None:
        assert rows.size == 0
    else:
        left, top, width, height = copy
        assert (columns.min(), rows.min()) == (left, top)
        assert (np.ptp(columns) + 1, np.ptp(rows) + 1) == (width, height)
        assert rows.size == width * height


def test_boxes_on_the_picture_and_on_its_copy_are_both_in_pixels_of_the_picture() -> None:
    sheet = Sheet(INPUT, (640, 480))
    on_whole, on_copy = box(65, 65, 130, 195), box(20, 330, 40, 410)
    boxes, scores = sheet.read(
        np.concatenate([on_copy, on_whole]), np.array([0.8, 0.9], np.float32)
    )
    assert boxes[0] == pytest.approx([100, 100, 200, 300])
    assert boxes[1] == pytest.approx([100, 50, 200, 450])
    assert scores == pytest.approx([0.9, 0.8])


@pytest.mark.parametrize(
    ("found", "kept"),
    [
        pytest.param(box(20, 330, 40, 374), True, id="46 % of the height"),
        pytest.param(box(20, 330, 40, 372), False, id="44 %: the picture itself shows them better"),
        pytest.param(box(200, 330, 230, 410), False, id="beside the copy"),
        pytest.param(box(10, 300, 60, 336), False, id="on the seam"),
    ],
)
def test_on_the_copy_only_large_people_count(found: np.ndarray, kept: bool) -> None:
    boxes, scores = Sheet(INPUT, (640, 480)).read(found, np.array([0.8], np.float32))
    assert (len(boxes), len(scores)) == (int(kept), int(kept))


def test_boxes_are_clipped_to_the_picture() -> None:
    boxes, _ = Sheet(INPUT, (640, 480)).read(box(-10, 312, 60, 440), np.ones(1, np.float32))
    assert boxes[0] == pytest.approx([0, 0, 300, 480])


@pytest.mark.parametrize("picture", [(640, 480), (416, 416)])
def test_nobody_stays_nobody(picture: tuple[int, int]) -> None:
    boxes, scores = Sheet(INPUT, picture).read(*NOBODY)
    assert (boxes.shape, scores.shape) == ((0, 4), (0,))
