"""Files as exporters, accidents and enemies make them: read right, or refused in one clear line.

Right is what onnxruntime makes of the file as it is, without any optimisation.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from heel.schemas import SettingsError
from heel.services.networks import person_model
from heel.services.networks.names import EngineName, HeadName
from heel.services.networks.person_model import PersonModel
from tests.unit.networks.drawn_networks import SIDE, picture, red_finder

onnx = pytest.importorskip("onnx")
ort = pytest.importorskip("onnxruntime")
from onnx import TensorProto, helper, numpy_helper  # noqa: E402

RED = (32, 24, 8, 8)
BOX = [24.0, 4.0, 48.0, 52.0]
"""What is found of it."""
Change = Callable[[Any], None]


def changed(file: Path, change: Change, kind: Any = "yolov8", **size: int) -> Path:
    model = onnx.load(str(red_finder(file, kind, **size)))
    change(model)
    onnx.save(model, str(file))
    return file


def golden(file: Path, blob: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """What onnxruntime makes of a file as it is, layer by layer."""
    options = ort.SessionOptions()
    options.graph_optimization_level = ort.GraphOptimizationLevel.ORT_DISABLE_ALL
    options.log_severity_level = 4
    session = ort.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])
    entry = session.get_inputs()[0]
    as_wanted = blob.astype(np.float16 if "float16" in entry.type else np.float32)
    return np.asarray(session.run(None, {entry.name: as_wanted})[0], np.float32)


def weight(name: str, values: Any, kind: Any = np.float32) -> Any:
    return numpy_helper.from_array(np.asarray(values, kind), name)


def first(model: Any, kind: str) -> Any:
    return next(node for node in model.graph.node if node.op_type == kind)


def before_the_input(model: Any, *nodes: Any) -> None:
    """Put nodes that make `seen` out of `picture` before all others."""
    for node in model.graph.node:
        for at, name in enumerate(node.input):
            if name == "picture":
                node.input[at] = "seen"
    for node in reversed(nodes):
        model.graph.node.insert(0, node)


def side(model: Any, *given: int | str) -> None:
    for one, length in zip(model.graph.input[0].type.tensor_type.shape.dim, given, strict=True):
        one.Clear()
        if isinstance(length, str):
            one.dim_param = length
        else:
            one.dim_value = length


def metadata(**said: str) -> Change:
    return lambda model: helper.set_model_props(model, said)


def both(*changes: Change) -> Change:
    def change(model: Any) -> None:
        for one in changes:
            one(model)

    return change


# What is unusual, and read right.


def own_padding(padding: str) -> Change:
    def change(model: Any) -> None:
        # The mean of 3x3 pixels and every second one, and each of them twice again.
        model.graph.initializer.append(weight("twice", [1, 1, 2, 2]))
        before_the_input(
            model,
            helper.make_node("MaxPool", ["picture"], ["half"], kernel_shape=[3, 3],
                             strides=[2, 2], auto_pad=padding),
            helper.make_node("Resize", ["half", "", "twice"], ["seen"], mode="nearest",
                             coordinate_transformation_mode="asymmetric", nearest_mode="floor"),
        )  # fmt: skip

    return change


def padded_kernel(model: Any) -> None:
    kernel = np.zeros((3, 3, 3, 3), np.float32)
    kernel[range(3), range(3), 1, 1] = 1.0
    model.graph.initializer.extend([weight("same", kernel), weight("twice", [1, 1, 2, 2])])
    before_the_input(
        model,
        helper.make_node("Conv", ["picture", "same"], ["half"], strides=[2, 2],
                         auto_pad="SAME_UPPER"),
        helper.make_node("Resize", ["half", "", "twice"], ["seen"], mode="nearest",
                         coordinate_transformation_mode="asymmetric", nearest_mode="floor"),
    )  # fmt: skip


def halved(kind: int, ends: bool) -> Change:
    def change(model: Any) -> None:
        for tensor in model.graph.initializer:
            if tensor.data_type == TensorProto.FLOAT:
                values = numpy_helper.to_array(tensor)
                half = helper.make_tensor(tensor.name, kind, values.shape, values.ravel().tolist())
                tensor.CopyFrom(half)
        if ends:
            model.graph.input[0].type.tensor_type.elem_type = kind
            model.graph.output[0].type.tensor_type.elem_type = kind
        else:
            before_the_input(model, helper.make_node("Cast", ["picture"], ["seen"], to=kind))
            last = model.graph.output[0].name
            first(model, "Add").output[0] = "halves"
            model.graph.node.append(helper.make_node("Cast", ["halves"], [last], to=1))

    return change


def constants_as_nodes(model: Any) -> None:
    nodes = [
        helper.make_node("Constant", [], [one.name], value=one) for one in model.graph.initializer
    ]
    del model.graph.initializer[:]
    before_the_input(model, *nodes, helper.make_node("Identity", ["picture"], ["seen"]))


def weights_as_inputs(model: Any) -> None:
    model.ir_version = 3
    for one in model.graph.initializer:
        model.graph.input.append(
            helper.make_tensor_value_info(one.name, one.data_type, list(one.dims))
        )


def function(model: Any) -> None:
    """A layer of its own, as newer PyTorch writes them."""
    body = [helper.make_node("Relu", ["x"], ["y"])]
    model.functions.append(
        helper.make_function("own", "Through", ["x"], ["y"], body, [helper.make_opsetid("", 13)])
    )
    model.opset_import.append(helper.make_opsetid("own", 1))
    before_the_input(model, helper.make_node("Through", ["picture"], ["seen"], domain="own"))


def branch(model: Any) -> None:
    out = helper.make_tensor_value_info("chosen", 1, None)
    yes = helper.make_graph([helper.make_node("Identity", ["picture"], ["chosen"])], "a", [], [out])
    no = helper.make_graph([helper.make_node("Neg", ["picture"], ["chosen"])], "b", [], [out])
    model.graph.initializer.append(weight("always", True, bool))
    before_the_input(
        model, helper.make_node("If", ["always"], ["seen"], then_branch=yes, else_branch=no)
    )


def grids_beside(model: Any) -> None:
    model.graph.output.append(helper.make_tensor_value_info("raw8", 1, [1, 5, 8, 8]))


def lying_about_shapes(model: Any) -> None:
    for one in model.graph.output[0].type.tensor_type.shape.dim:
        one.dim_value = 77
    model.graph.value_info.append(helper.make_tensor_value_info("raw8", 1, [9, 9, 9, 9]))


def shares(model: Any) -> None:
    last = model.graph.output[0].name
    first(model, "Add").output[0] = "pixels"
    per = [[1 / SIDE], [1 / SIDE], [1 / SIDE], [1 / SIDE], [1.0]]
    model.graph.initializer.append(weight("per", [per]))
    model.graph.node.append(helper.make_node("Mul", ["pixels", "per"], [last]))


def turned(model: Any) -> None:
    last = model.graph.output[0].name
    first(model, "Add").output[0] = "columns_"
    model.graph.node.append(helper.make_node("Transpose", ["columns_"], [last], perm=[0, 2, 1]))
    model.graph.output[0].type.tensor_type.shape.CopyFrom(
        helper.make_tensor_value_info("", 1, [1, 84, 5]).type.tensor_type.shape
    )


def quantised_weights(model: Any) -> None:
    tensor = next(one for one in model.graph.initializer if one.name == "kernel8")
    values = numpy_helper.to_array(tensor)
    step = float(np.abs(values).max() / 127)
    tensor.CopyFrom(weight("q", np.round(values / step), np.int8))
    model.graph.initializer.extend([weight("step", step), weight("zero", 0, np.int8)])
    model.graph.node.insert(
        0, helper.make_node("DequantizeLinear", ["q", "step", "zero"], ["kernel8"])
    )


def strange_names(model: Any) -> None:
    for node in model.graph.node:
        for names in (node.input, node.output):
            for at, name in enumerate(names):
                if name in ("picture", "raw8"):
                    names[at] = f"{name}\n\x1b[31m/µ:0"
    model.graph.input[0].name = "picture\n\x1b[31m/µ:0"


def boxes_chosen(kind: HeadName) -> Change:
    """The best boxes as a list, with the class in it."""

    def change(model: Any) -> None:
        order = {
            "yolov10": ["corners", "score", "class"],
            "yolov7-nms": ["batch", "corners", "class", "score"],
            "yolox-nms": ["batch", "class", "score", "corners"],
        }[kind]
        to_corners = np.zeros((4, 5), np.float32)
        for row, (at, sign) in enumerate([(0, -0.5), (1, -0.5), (0, 0.5), (1, 0.5)]):
            to_corners[row, at], to_corners[row, at + 2] = 1.0, sign
        only_score = np.array([[0, 0, 0, 0, 1]], np.float32)
        last = model.graph.output[0].name
        first(model, "Add").output[0] = "all"
        model.graph.initializer.extend([
            weight("to_corners", to_corners), weight("only_score", only_score),
            weight("nought", np.zeros((1, 5))), weight("five", [5], np.int64),
            weight("axis1", [1], np.int64),
        ])  # fmt: skip
        parts = {"corners": "to_corners", "score": "only_score", "class": "nought",
                 "batch": "nought"}  # fmt: skip
        nodes = [helper.make_node("MatMul", [parts[one], "all"], [one]) for one in order]
        nodes += [
            helper.make_node("Concat", order, ["listed"], axis=1),
            helper.make_node("MatMul", ["only_score", "all"], ["ranking"]),
            helper.make_node("TopK", ["ranking", "five"], ["best", "where_"], axis=2),
            helper.make_node("Squeeze", ["where_", "axis1"], ["where2"]),
            helper.make_node("Squeeze", ["where2", "axis0"], ["where"]),
            helper.make_node("Gather", ["listed", "where"], ["chosen"], axis=2),
            helper.make_node("Transpose", ["chosen"], [last], perm=[0, 2, 1]),
        ]
        model.graph.initializer.append(weight("axis0", [0], np.int64))
        model.graph.node.extend(nodes)
        model.graph.output[0].type.tensor_type.shape.CopyFrom(
            helper.make_tensor_value_info("", 1, [1, "n", "c"]).type.tensor_type.shape
        )

    return change


def suppressed(model: Any) -> None:
    """Non-maximum suppression inside, with as many boxes as it leaves: (N, 6)."""
    boxes_chosen("yolov10")(model)
    last = model.graph.output[0].name
    model.graph.node[-1].output[0] = "candidates"
    model.graph.initializer.extend([
        weight("start4", [0, 0, 0], np.int64), weight("end4", [1, 99, 4], np.int64),
        weight("start5", [0, 0, 4], np.int64), weight("end5", [1, 99, 5], np.int64),
        weight("most", [9], np.int64), weight("iou", [0.5]), weight("least", [0.25]),
        weight("third", 2, np.int64),
    ])  # fmt: skip
    model.graph.node.extend([
        helper.make_node("Slice", ["candidates", "start4", "end4"], ["c4"]),
        helper.make_node("Slice", ["candidates", "start5", "end5"], ["c5"]),
        helper.make_node("Transpose", ["c5"], ["c5t"], perm=[0, 2, 1]),
        helper.make_node("NonMaxSuppression", ["c4", "c5t", "most", "iou", "least"], ["kept"]),
        helper.make_node("Gather", ["kept", "third"], ["rows_"], axis=1),
        helper.make_node("Squeeze", ["candidates", "axis0"], ["flat"]),
        helper.make_node("Gather", ["flat", "rows_"], [last], axis=0),
    ])  # fmt: skip
    model.graph.output[0].type.tensor_type.shape.CopyFrom(
        helper.make_tensor_value_info("", 1, ["n", 6]).type.tensor_type.shape
    )


def third_of_three(model: Any) -> None:
    """Three classes, of which the last is the person and the first two are surer."""
    add = first(model, "Add")
    last, add.output[0] = add.output[0], "five_rows"
    spread = np.zeros((7, 5), np.float32)
    spread[:4, :4] = np.eye(4)
    spread[6, 4] = 1.0
    model.graph.initializer.append(weight("spread", spread))
    model.graph.node.append(helper.make_node("MatMul", ["spread", "five_rows"], [last]))
    helper.set_model_props(model, {"names": "{0: 'car', 1: 'dog', 2: 'Person'}", "task": "detect"})


def with_objectness(model: Any, score_in: int) -> str:
    """Rows of box, objectness and class; the score in one of the two, 1 in the other."""
    first(model, "Add").output[0] = "five_rows"
    spread = np.zeros((6, 5), np.float32)
    spread[:4, :4] = np.eye(4)
    spread[score_in, 4] = 1.0
    one = np.zeros((1, 6, 1), np.float32)
    one[0, 9 - score_in] = 1.0
    model.graph.initializer.extend([weight("spread", spread), weight("one", one)])
    model.graph.node.extend([
        helper.make_node("MatMul", ["spread", "five_rows"], ["six"]),
        helper.make_node("Add", ["six", "one"], ["six_rows"]),
    ])  # fmt: skip
    helper.set_model_props(model, {"names": "['person']"})
    return "six_rows"


def as_rows(model: Any, columns: str, count: int) -> None:
    last = model.graph.output[0].name
    model.graph.node.append(helper.make_node("Transpose", [columns], [last], perm=[0, 2, 1]))
    model.graph.output[0].type.tensor_type.shape.CopyFrom(
        helper.make_tensor_value_info("", 1, [1, count, 6]).type.tensor_type.shape
    )


def yolov6(model: Any) -> None:
    as_rows(model, with_objectness(model, 5), 84)


def yolov5(model: Any) -> None:
    """Three rows for every cell, grid by grid."""
    grids = np.split(np.arange(84), [64, 80])
    order = np.concatenate([np.tile(grid, 3) for grid in grids])
    model.graph.initializer.append(weight("order", order, np.int64))
    rows = with_objectness(model, 4)
    model.graph.node.append(helper.make_node("Gather", [rows, "order"], ["anchors"], axis=2))
    as_rows(model, "anchors", 252)


def newer(opset: int, ir: int) -> Change:
    def change(model: Any) -> None:
        model.opset_import[0].version, model.ir_version = opset, ir

    return change


def tiny_weights(model: Any) -> None:
    """So small that processors compute with them a hundred times slower, unless they are told."""
    tensor = next(one for one in model.graph.initializer if one.name == "kernel16")
    tensor.CopyFrom(weight("kernel16", np.full(tensor.dims, 1e-40)))


def yolov10_of_ultralytics(model: Any) -> None:
    boxes_chosen("yolov10")(model)
    metadata(names="{0: 'person'}", task="detect", stride="32", author="Ultralytics")(model)


READ: dict[str, tuple[Change, dict[str, Any]]] = {
    "pads itself, SAME_UPPER, in a maximum": (own_padding("SAME_UPPER"), {}),
    "pads itself, SAME_LOWER, in a maximum": (own_padding("SAME_LOWER"), {}),
    "pads itself, SAME_UPPER, in a layer": (padded_kernel, {}),
    "any number of pictures": (lambda m: side(m, "batch", 3, SIDE, SIDE), {}),
    "no number of pictures": (lambda m: side(m, 0, 3, SIDE, SIDE), {}),
    "any size, with one proposed": (
        both(lambda m: side(m, "b", 3, "h", "w"), metadata(imgsz="[64, 64]")), {},
    ),
    "any size and channels, with one proposed": (
        both(lambda m: side(m, "b", "c", "h", "w"), metadata(imgsz="64")), {},
    ),
    "16-bit floats": (halved(TensorProto.FLOAT16, True), {}),
    "16-bit floats inside": (halved(TensorProto.FLOAT16, False), {}),
    "weights as nodes": (constants_as_nodes, {}),
    "weights as inputs": (weights_as_inputs, {}),
    "a layer of its own": (function, {}),
    "a branch": (branch, {}),
    "grids beside the boxes": (grids_beside, {}),
    "wrong shapes of inner values": (lying_about_shapes, {}),
    "boxes as shares": (shares, {}),
    "turned": (turned, {}),
    "8-bit weights": (quantised_weights, {}),
    "names with line breaks": (strange_names, {}),
    "tiny weights": (tiny_weights, {}),
    "opset 14": (newer(14, 8), {}),
    "opset 21": (newer(21, 10), {}),
    "the person is the third class": (third_of_three, {}),
    "YOLOv5": (yolov5, {}),
    "YOLOv6": (yolov6, {}),
    "YOLOv10 of Ultralytics": (yolov10_of_ultralytics, {}),
    "a list, as YOLOv10": (boxes_chosen("yolov10"), {"head": "yolov10", "person_class": 0}),
    "a list, as YOLOv7": (boxes_chosen("yolov7-nms"), {"head": "yolov7-nms", "person_class": 0}),
    "non-maximum suppression inside": (suppressed, {"head": "yolov10", "person_class": 0}),
}  # fmt: skip

HEADS = {"YOLOv5": "yolov5", "YOLOv6": "yolov6", "YOLOv10 of Ultralytics": "yolov10"}
NOT_RUN = {"no number of pictures"}
"""What onnxruntime does not run as it is; right is what it makes of the network before."""


@pytest.mark.parametrize("engine", ["onnxruntime", "opencv"])
@pytest.mark.parametrize("case", READ)
def test_what_is_unusual_is_read_right(case: str, engine: EngineName, tmp_path: Path) -> None:
    file = tmp_path / "net.onnx"
    change, given = READ[case]
    try:
        model = PersonModel(changed(file, change), engine=engine, **given)
    except SettingsError as refused:
        if engine == "onnxruntime" or "\n" in str(refused):
            raise
        pytest.skip(f"OpenCV does not run it: {refused}")
    image = picture(SIDE, SIDE, RED)
    found = model.detect(image, 0.5)
    assert found.boxes[0] == pytest.approx(BOX, abs=0.1)
    assert found.scores[0] == pytest.approx(1.0, abs=0.25 if "maximum" in case else 0.01)
    assert len(found.boxes) == 1
    assert model.head == HEADS.get(case, given.get("head", "yolov8"))
    blob = person_model._blob(image, model._head.form)
    as_it_is = red_finder(tmp_path / "plain.onnx", "yolov8") if case in NOT_RUN else file
    right = golden(as_it_is, blob)
    ours = model._engine.run(blob, [model._head.output])[0]
    assert ours == pytest.approx(right, abs=0.05 if "16-bit" in case else 1e-3)


# What is damaged or hostile, or cannot be a network for this.


def attribute(kind: str, name: str, *values: int) -> Change:
    def change(model: Any) -> None:
        node = first(model, kind)
        for at in reversed(range(len(node.attribute))):
            if node.attribute[at].name == name:
                del node.attribute[at]
        node.attribute.append(helper.make_attribute(name, values[0] if name == "group" else values))

    return change


def endless(model: Any) -> None:
    body = helper.make_graph(
        [helper.make_node("Identity", ["go"], ["on"]), helper.make_node("Identity", ["v"], ["w"])],
        "body",
        [helper.make_tensor_value_info("turn", TensorProto.INT64, []),
         helper.make_tensor_value_info("go", TensorProto.BOOL, []),
         helper.make_tensor_value_info("v", 1, None)],
        [helper.make_tensor_value_info("on", TensorProto.BOOL, []),
         helper.make_tensor_value_info("w", 1, None)],
    )  # fmt: skip
    model.graph.initializer.append(weight("always", True, bool))
    before_the_input(
        model, helper.make_node("Loop", ["", "always", "picture"], ["seen"], body=body)
    )


def memory(count: int) -> Change:
    def change(model: Any) -> None:
        model.graph.initializer.append(weight("many", [count], np.int64))
        before_the_input(
            model,
            helper.make_node("ConstantOfShape", ["many"], ["zeros"]),
            helper.make_node("ReduceMax", ["zeros"], ["zero"], keepdims=0),
            helper.make_node("Add", ["picture", "zero"], ["seen"]),
        )

    return change


def not_finite(model: Any) -> None:
    tensor = next(one for one in model.graph.initializer if one.name == "places")
    values = numpy_helper.to_array(tensor).copy()
    values[0, 4] = np.nan
    tensor.CopyFrom(weight("places", values))


def dice(model: Any) -> None:
    shape = [1, 3, SIDE, SIDE]
    before_the_input(model, helper.make_node("RandomUniform", [], ["seen"], shape=shape))


def deep(model: Any) -> None:
    graph = helper.make_graph([], "g", [], [])
    for _ in range(25):
        node = helper.make_node("If", ["always"], ["x"], then_branch=graph, else_branch=graph)
        del node.attribute[1]
        graph = helper.make_graph([node], "g", [], [])
    model.graph.initializer.append(weight("always", True, bool))
    before_the_input(model, helper.make_node("If", ["always"], ["seen"], then_branch=graph))


def text_output(model: Any) -> None:
    last = model.graph.output[0].name
    first(model, "Add").output[0] = "numbers"
    model.graph.node.append(helper.make_node("Cast", ["numbers"], [last], to=TensorProto.STRING))
    model.graph.output[0].type.tensor_type.elem_type = TensorProto.STRING


def to_itself(model: Any) -> None:
    model.graph.node[0].input[0] = model.graph.node[0].output[0]


def twice_the_same(model: Any) -> None:
    model.graph.node[3].output[0] = model.graph.node[0].output[0]


def outside(place: str) -> Change:
    def change(model: Any) -> None:
        tensor = model.graph.initializer[0]
        tensor.ClearField("raw_data")
        tensor.data_location = TensorProto.EXTERNAL
        tensor.external_data.add(key="location", value=place)

    return change


def missing_output(model: Any) -> None:
    model.graph.output[0].name = "nothing"


def input_without_shape(model: Any) -> None:
    model.graph.input[0].type.tensor_type.ClearField("shape")


def pads_itself_to_nobody_knows(model: Any) -> None:
    attribute("Conv", "auto_pad")
    node = first(model, "Conv")
    node.attribute.append(helper.make_attribute("auto_pad", "SAME_BUT_DIFFERENT"))


def out_of_range(model: Any) -> None:
    node = first(model, "Concat")
    node.attribute[0].i = 7


REFUSED: dict[str, tuple[Change, dict[str, Any], str]] = {
    "a gap of 0": (attribute("Conv", "dilations", 0, 1), {}, "dilations 0.*damaged"),
    "a window of 0": (attribute("Conv", "kernel_shape", 0, 0), {}, "kernel_shape 0.*damaged"),
    "no groups": (attribute("Conv", "group", 0), {}, "group 0.*damaged"),
    "three strides": (attribute("Conv", "strides", 8, 8, 8), {}, "cannot run it"),
    "less padding than none": (attribute("Conv", "pads", -9, -9, -9, -9), {}, "cannot run it"),
    "padding unknown": (pads_itself_to_nobody_knows, {}, "auto_pad 'SAME_BUT_DIFFERENT'"),
    "an axis beyond": (out_of_range, {}, "cannot run it"),
    "an endless loop": (endless, {}, "cannot run it"),
    "a terabyte": (memory(1 << 38), {}, "more than 4 GiB|cannot run it"),
    "6 gigabytes": (memory(3 << 29), {}, "more than 4 GiB"),
    "no numbers": (not_finite, {}, "no numbers .NaN"),
    "dice": (dice, {}, "depend on chance"),
    "graphs in graphs": (deep, {}, "cannot run it|damaged"),
    "a text as output": (text_output, {}, "no array of numbers"),
    "a layer of itself": (to_itself, {}, "no layer before it gives"),
    "two of one name": (twice_the_same, {}, "cannot run it|damaged"),
    "an output of nothing": (missing_output, {}, "."),
    "weights in another folder": (outside("/etc/hostname"), {}, "not beside the file"),
    "weights above": (outside("../../../etc/hostname"), {}, "not beside the file"),
    "weights nowhere": (outside(""), {}, "not beside the file"),
    "eight pictures": (lambda m: side(m, 8, 3, SIDE, SIDE), {}, "8 pictures.*batch of one"),
    "grey pictures": (lambda m: side(m, 1, 1, SIDE, SIDE), {}, "1x1x64x64; give a network"),
    "pictures with depth": (lambda m: side(m, 1, 4, SIDE, SIDE), {}, "takes an input of 1x4"),
    "huge pictures": (lambda m: side(m, 1, 3, 65536, 65536), {}, "fixed input size"),
    "another size than its own": (lambda m: side(m, 1, 3, 96, 96), {}, "cannot run it|none that"),
    "an input without shape": (input_without_shape, {}, "takes an input of"),
    "a future version": (newer(99, 99), {}, "cannot run it"),
    "a layer of another maker": (
        lambda m: before_the_input(
            m, helper.make_node("Magic", ["picture"], ["seen"], domain="maker")
        ),
        {}, "cannot run it",
    ),
    "names of no people": (metadata(names="{0: 'car\\n\\x1b[31m'}", task="detect"), {},
                           "none of its 1 classes is a person"),
    "names of another number": (metadata(names="{0: 'a', 1: 'person'}", task="detect"), {},
                                "do not fit the 2 class names"),
    "a class beyond": ((lambda m: None), {"person_class": 4}, "it has 1 classes"),
    "a list, of which nothing is said": (boxes_chosen("yolov10"), {},
                                         "--model-head, which is one of yolov10"),
    "a list, of another order": (boxes_chosen("yolov7-nms"), {"head": "yolox-nms"},
                                 "not those of yolox-nms"),
    "no list": ((lambda m: None), {"head": "yolov10"}, "is no list of 6 columns"),
    "another head": ((lambda m: None), {"head": "yolov5"}, "5 columns do not fit it: leave it out"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_damaged_or_hostile_is_refused_in_a_line(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(person_model, "_LONGEST_PROBE_S", 0.5)
    change, given, message = REFUSED[case]
    file = changed(tmp_path / "net.onnx", change)
    with pytest.raises(SettingsError, match=message) as refused:
        PersonModel(file, **given)
    said = str(refused.value)
    assert said.startswith(f"model {file}: ")
    assert said.isprintable(), "no line breaks, no codes for a terminal"
    assert len(said) < 900
    assert capfd.readouterr().err == "", "said once, by us"


def test_a_file_larger_than_any_network_is_not_read(tmp_path: Path) -> None:
    file = tmp_path / "net.onnx"
    content = red_finder(file).read_bytes()
    with file.open("wb") as stream:
        stream.write(content)
        stream.truncate(3 << 30)
    with pytest.raises(SettingsError, match=r"3.2 GB: no network for a robot"):
        PersonModel(file)


def test_what_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.onnx"
    os.mkfifo(pipe)
    for file in (pipe, Path("/dev/zero")):
        with pytest.raises(SettingsError, match="no such file"):
            PersonModel(file)


def test_of_cut_and_changed_files_each_is_right_or_refused(tmp_path: Path) -> None:
    file = tmp_path / "net.onnx"
    content = red_finder(file, "yolov8").read_bytes()
    rng = np.random.default_rng(8)
    image = picture(SIDE, SIDE, RED)
    refused = read = 0
    for number in range(40):
        damaged = bytearray(content)
        if number % 4 == 0:
            del damaged[int(rng.integers(len(content))) :]
        else:
            # What says what the numbers mean, before and behind them.
            at = int(rng.choice([rng.integers(400), len(content) - 1 - rng.integers(400)]))
            damaged[at] = int(rng.integers(256))
        file.write_bytes(damaged)
        try:
            model = PersonModel(file)
        except SettingsError as error:
            refused += str(error).isprintable()
            continue
        read += 1
        blob = person_model._blob(image, model._head.form)
        ours = model._engine.run(blob, [model._head.output])[0]
        assert ours == pytest.approx(golden(file, blob), abs=1e-3)
    assert refused + read == 40, "all in one line"
    assert refused > 15
