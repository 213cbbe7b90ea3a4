"""A network without what nobody reads: the same numbers in the columns that are left."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from heel.services.networks.engines import OnnxRuntime
from heel.services.networks.onnx_file import read_onnx_file
from heel.services.networks.person_model import PersonModel
from heel.services.networks.shortening import shortened
from tests.unit.networks.drawn_networks import picture, red_finder, saved

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")
from onnx import helper, numpy_helper  # noqa: E402

SIDE = 32
CELLS = (SIDE // 2) ** 2


def like_yolox(file: Path, classes: int = 80, slices: tuple[int, ...] = (0, 1, 2, 3)) -> Path:
    """Every second pixel four times, a layer, and boxes, objectness and classes joined to rows."""
    rng = np.random.default_rng(11)
    weights = [
        numpy_helper.from_array(rng.normal(0, 1, shape).astype(np.float32), name)
        for name, shape in {
            "stem": (8, 12, 3, 3), "stem_b": (8,), "box": (4, 8, 1, 1), "box_b": (4,),
            "thing": (1, 8, 1, 1), "thing_b": (1,), "class": (classes, 8, 1, 1),
            "class_b": (classes,),
        }.items()
    ]  # fmt: skip
    columns = 5 + classes
    for name, values in {
        "two": [2], "end": [2**31 - 1], "rows": [2], "across": [3],
        "start0": [0], "start1": [1], "shape": [1, columns, -1],
    }.items():  # fmt: skip
        weights.append(numpy_helper.from_array(np.array(values, np.int64), name))
    nodes = []
    for part, place in enumerate(slices):
        down, right = place % 2, place // 2
        nodes += [
            helper.make_node("Slice", ["picture", f"start{down}", "end", "rows", "two"],
                             [f"rows{part}"]),
            helper.make_node("Slice", [f"rows{part}", f"start{right}", "end", "across", "two"],
                             [f"part{part}"]),
        ]  # fmt: skip
    nodes += [
        helper.make_node("Concat", [f"part{part}" for part in range(4)], ["parts"], axis=1),
        helper.make_node("Conv", ["parts", "stem", "stem_b"], ["seen"], pads=[1] * 4),
        helper.make_node("Conv", ["seen", "box", "box_b"], ["boxes"]),
        helper.make_node("Conv", ["seen", "thing", "thing_b"], ["thing_raw"]),
        helper.make_node("Conv", ["seen", "class", "class_b"], ["class_raw"]),
        helper.make_node("Sigmoid", ["thing_raw"], ["things"]),
        helper.make_node("Sigmoid", ["class_raw"], ["classes"]),
        helper.make_node("Concat", ["boxes", "things", "classes"], ["joined"], axis=1),
        helper.make_node("Reshape", ["joined", "shape"], ["flat"]),
        helper.make_node("Transpose", ["flat"], ["out"], perm=[0, 2, 1]),
    ]
    return saved(file, nodes, weights, ("out", [1, CELLS, columns]), [1, 3, SIDE, SIDE])


def outputs(network: bytes) -> np.ndarray[Any, Any]:
    blob = np.random.default_rng(2).normal(0, 1, (1, 3, SIDE, SIDE)).astype(np.float32)
    return OnnxRuntime(network).run(blob, ["out"])[0]


def kinds(network: bytes) -> list[str]:
    return [node.op_type for node in onnx.load_from_string(network).graph.node]


@pytest.mark.parametrize("columns", [(0, 1, 2, 3, 4, 5), (0, 1, 2, 3, 4, 17), (0, 1, 2, 5, 9)])
def test_the_columns_left_are_what_they_were(columns: tuple[int, ...], tmp_path: Path) -> None:
    network = read_onnx_file(like_yolox(tmp_path / "net.onnx")).network
    short, alone = shortened(network, "out", 2, columns)
    assert alone
    found, right = outputs(short), outputs(network)
    assert found.shape == (1, CELLS, len(columns))
    assert found == pytest.approx(right[:, :, columns], abs=1e-3)
    assert len(short) < len(network) - 4 * 70 * 8, "the weights of the other classes are left out"


@pytest.mark.parametrize("slices", [(0, 1, 2, 3), (3, 0, 2, 1)])
def test_every_second_pixel_four_times_becomes_one_layer(
    slices: tuple[int, ...], tmp_path: Path
) -> None:
    network = read_onnx_file(like_yolox(tmp_path / "net.onnx", slices=slices)).network
    short, _ = shortened(network, "out", 2, range(85))
    assert "Slice" not in kinds(short)
    assert kinds(short).count("Conv") == 4
    assert outputs(short) == pytest.approx(outputs(network), abs=1e-3)


def test_slices_of_other_pixels_stay(tmp_path: Path) -> None:
    network = read_onnx_file(like_yolox(tmp_path / "net.onnx", slices=(0, 1, 2, 2))).network
    short, _ = shortened(network, "out", 2, range(85))
    assert "Slice" in kinds(short)
    assert outputs(short) == pytest.approx(outputs(network), abs=1e-3)


def shared(model: Any) -> None:
    """The classes are used for something else as well."""
    model.graph.node.insert(7, helper.make_node("ReduceMax", ["classes"], ["best"], keepdims=0))
    model.graph.node.append(model.graph.node[-1])
    model.graph.node[-2].output[0] = "rows_alone"
    model.graph.node[-1].CopyFrom(helper.make_node("Add", ["rows_alone", "best"], ["out"]))


def mixed(model: Any) -> None:
    model.graph.node[-1].output[0] = "rows_alone"
    model.graph.node.append(
        helper.make_node("Softmax", ["rows_alone"], ["out"], axis=2)
    )  # fmt: skip


@pytest.mark.parametrize("change", [shared, mixed])
def test_what_depends_on_all_columns_keeps_them(change: Any, tmp_path: Path) -> None:
    model = onnx.load(str(like_yolox(tmp_path / "net.onnx")))
    change(model)
    network = model.SerializeToString()
    short, alone = shortened(network, "out", 2, range(6))
    assert not alone
    assert outputs(short) == pytest.approx(outputs(network), abs=1e-3)


def test_a_model_reads_of_eighty_classes_the_person_alone(tmp_path: Path) -> None:
    file = red_finder(tmp_path / "net.onnx")
    model = onnx.load(str(file))
    for tensor in model.graph.initializer:
        values = numpy_helper.to_array(tensor)
        if tensor.name.startswith("shape"):
            more = np.array([1, 85, -1])
        else:
            more = np.concatenate([values[:5], np.zeros((80, *values.shape[1:]), np.float32)])
            if tensor.name.startswith("bias"):
                more[5:] = 0.3
                more[5 + 61] = 1.0
        tensor.CopyFrom(numpy_helper.from_array(more, tensor.name))
    names = [f"thing of kind {number}" for number in range(80)]
    names[61] = "person"
    onnx.helper.set_model_props(model, {"names": str(names)})
    onnx.save(model, str(file))
    found = PersonModel(file, engine="onnxruntime")
    assert "class 61 (person) of 80" in found.description
    assert found._head.people == (5,), "the first column of classes now"
    image = picture(64, 64, (32, 24, 8, 8))
    ours = found.detect(image, 0.5)
    theirs = PersonModel(file, engine="opencv").detect(image, 0.5)
    assert ours.scores == pytest.approx([1.0], abs=0.01)
    assert ours.boxes == pytest.approx(theirs.boxes, abs=1e-3)
    assert ours.scores == pytest.approx(theirs.scores, abs=1e-3)
