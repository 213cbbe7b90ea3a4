"""Networks read from files: what their output means, where their boxes lie, what is refused."""

from __future__ import annotations

import builtins
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from heel.schemas import SettingsError
from heel.services.networks.heads import Head, cells, people
from heel.services.networks.names import HeadName
from heel.services.networks.person_model import PersonModel, without_doubles
from tests.unit.networks.drawn_networks import BOX, SIDE, Kind, picture, red_finder, saved

onnx = pytest.importorskip("onnx")
KINDS: list[Kind] = ["yolox", "yolox-decoded", "yolov8"]


def rows(count: int, *given: tuple[int, list[float]]) -> np.ndarray[Any, np.dtype[np.float32]]:
    out = np.zeros((1, count, 7), np.float32)
    for index, values in given:
        out[0, index] = values
    return out


def head(name: HeadName, *columns: int, turned: bool = False) -> Head:
    return Head(name, "out", turned, unit_boxes=False, people=columns, why="")


def test_a_raw_yolox_row_is_an_offset_in_its_cell_and_a_logarithmic_size() -> None:
    # Cell 9 of the 8x8 grid of stride 8 is column 1, row 1; cell 64 the first of stride 16.
    count = cells(SIDE, SIDE)
    given = rows(
        count, (9, [0.5, 0.25, 0, np.log(2), 0.5, 0.8, 0.9]), (64, [1, 0, 0, 0, 1, 0.5, 0])
    )
    boxes, scores = people(given, head("yolox", 5), SIDE, SIDE)
    assert boxes[9] == pytest.approx([12 - 4, 10 - 8, 12 + 4, 10 + 8])
    assert boxes[64] == pytest.approx([16 - 8, -8, 16 + 8, 8])
    assert scores[[9, 64]] == pytest.approx([0.4, 0.5])


def test_a_yolov8_column_is_a_decoded_box_and_its_class_scores() -> None:
    given = np.zeros((1, 7, cells(SIDE, SIDE)), np.float32)
    given[0, :, 3] = [30, 20, 10, 24, 0.7, 0.9, 0.8]
    for columns, score in (((4,), 0.7), ((5,), 0.9), ((4, 6), 0.8)):
        boxes, scores = people(given, head("yolov8", *columns, turned=True), SIDE, SIDE)
        assert boxes[3] == pytest.approx([25, 8, 35, 32])
        assert scores[3] == pytest.approx(score), "the surest of the classes that are people"


@pytest.mark.parametrize("kind", KINDS)
def test_head_colour_order_and_range_are_those_of_the_kind_of_network(
    kind: Kind, tmp_path: Path
) -> None:
    model = PersonModel(red_finder(tmp_path / "net.onnx", kind))
    assert (model.head, model.width, model.height) == (kind, SIDE, SIDE)
    found = model.detect(picture(SIDE, SIDE, (32, 24, 8, 8)), 0.5)
    assert found.scores == pytest.approx([1.0], abs=0.01)
    assert found.boxes[0] == pytest.approx([36 - 12, 28 - 24, 36 + 12, 28 + 24], abs=0.01)


@pytest.mark.parametrize(("width", "height"), [(128, 128), (128, 64), (64, 128), (32, 32)])
def test_boxes_are_in_pixels_of_the_picture_whatever_its_shape(
    width: int, height: int, tmp_path: Path
) -> None:
    model = PersonModel(red_finder(tmp_path / "net.onnx"))
    scale = SIDE / max(width, height)
    cell = round(8 / scale)
    found = model.detect(picture(width, height, (2 * cell, cell, cell, cell)), 0.5)
    x, y = 2.5 * cell, 1.5 * cell
    across, down = BOX[0] / 2 / scale, BOX[1] / 2 / scale
    wanted = np.array([x - across, y - down, x + across, y + down])
    assert found.boxes[0] == pytest.approx(np.clip(wanted, 0, [width, height] * 2), abs=0.5)


def test_an_input_that_is_not_square_is_read_from_the_file(tmp_path: Path) -> None:
    model = PersonModel(red_finder(tmp_path / "net.onnx", width=128, height=64))
    assert (model.width, model.height) == (128, 64)
    assert len(model.detect(picture(256, 128, (64, 32, 16, 16)), 0.5).boxes) == 1


def test_of_boxes_on_one_person_the_best_is_kept_and_others_stay() -> None:
    boxes = np.array([[0, 0, 20, 40], [2, 0, 22, 40], [60, 0, 80, 40], [5, 5, 5, 9]], np.float32)
    kept = without_doubles(boxes, np.array([0.6, 0.9, 0.5, 0.99], np.float32))
    assert kept.tolist() == [1, 2]


def test_nobody_is_found_in_an_empty_picture(tmp_path: Path) -> None:
    found = PersonModel(red_finder(tmp_path / "net.onnx")).detect(picture(90, 70), 0.1)
    assert (found.boxes.shape, found.scores.shape) == ((0, 4), (0,))


def _identity(file: Path, shape: list[int | str]) -> Path:
    return saved(
        file, [onnx.helper.make_node("Relu", ["picture"], ["out"])], [], ("out", shape), shape
    )


def _missing(folder: Path) -> Path:
    return folder / "none.onnx"


def _text(folder: Path) -> Path:
    (folder / "model.onnx").write_text("these are not the weights you are looking for")
    return folder / "model.onnx"


def _too_wide(folder: Path) -> Path:
    return _identity(folder / "net.onnx", [1, 3, 64, 4096])


def _no_picture(folder: Path) -> Path:
    return _identity(folder / "net.onnx", [1, 1000])


def _no_head(folder: Path) -> Path:
    return _identity(folder / "net.onnx", [1, 3, 64, 64])


def _unknown_layer(folder: Path) -> Path:
    node = onnx.helper.make_node("NoSuchLayer", ["picture"], ["out"])
    return saved(folder / "net.onnx", [node], [], ("out", [1, 3, 64, 64]), [1, 3, 64, 64])


def _huge(folder: Path) -> Path:
    weight = onnx.numpy_helper.from_array(np.ones((8, 3, 3, 3), np.float32), "weight")
    node = onnx.helper.make_node("Conv", ["picture", "weight"], ["out"], pads=[90_000] * 4)
    shape: list[int | str] = [1, 3, 64, 64]
    return saved(folder / "net.onnx", [node], [weight], ("out", [1, 8, "h", "w"]), shape)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (_huge, "wants more than 4 GiB of memory"),
        (_missing, "no such file; give the path of an ONNX network"),
        (_text, "a text, not an ONNX network"),
        (_too_wide, "export it with a fixed input size"),
        (_no_picture, "give a network that takes one picture"),
        (_no_head, "export the network without its own non-maximum suppression"),
        (_unknown_layer, "the engine cannot run it"),
    ],
)
def test_a_model_that_cannot_be_used_is_named_with_the_remedy(
    made: Any, message: str, tmp_path: Path
) -> None:
    file = made(tmp_path)
    with pytest.raises(SettingsError, match=message) as refused:
        PersonModel(file)
    assert str(file) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_without_the_package_that_reads_networks_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = builtins.__import__

    def refusing(name: str, *rest: Any, **named: Any) -> Any:
        if name == "onnx":
            raise ImportError(name)
        return real(name, *rest, **named)

    file = red_finder(tmp_path / "net.onnx")
    monkeypatch.setattr(builtins, "__import__", refusing)
    with pytest.raises(SettingsError, match="pip install onnx"):
        PersonModel(file)
