"""Networks made of one convolution: they find red, so that nothing has to be learned or shipped."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

Kind = Literal["yolox", "yolox-decoded", "yolov8"]
SIDE = 64
BOX = (24.0, 48.0)
"""Width and height of every box, pixels of the network's input."""
STRIDES = (8, 16, 32)
RED, GREY = (0, 0, 255), (114, 114, 114)


def red_finder(file: Path, kind: Kind = "yolox", width: int = SIDE, height: int = SIDE) -> Path:
    """Write a network with one box about the centre of every 8x8 cell, its score the redness."""
    red, scale = (0, 1.0) if kind == "yolov8" else (2, 1.0 / 255.0)
    nodes, weights, parts = [], [], []
    for stride in STRIDES:
        kernel, bias = _cell(kind, stride, red, scale)
        weights += [
            numpy_helper.from_array(kernel, f"kernel{stride}"),
            numpy_helper.from_array(bias, f"bias{stride}"),
            numpy_helper.from_array(np.array([1, len(bias), -1], np.int64), f"shape{stride}"),
        ]
        nodes += [
            helper.make_node(
                "Conv", ["picture", f"kernel{stride}", f"bias{stride}"], [f"raw{stride}"],
                kernel_shape=[stride, stride], strides=[stride, stride],
            ),
            helper.make_node("Relu", [f"raw{stride}"], [f"cell{stride}"]),
            helper.make_node("Reshape", [f"cell{stride}", f"shape{stride}"], [f"flat{stride}"]),
        ]  # fmt: skip
        parts.append(f"flat{stride}")
    nodes.append(helper.make_node("Concat", parts, ["columns"], axis=2))
    last = "columns"
    if kind != "yolox":
        places = _centres(width, height, rows=5 if kind == "yolov8" else 6)
        weights.append(numpy_helper.from_array(places, "places"))
        nodes.append(helper.make_node("Add", [last, "places"], ["placed"]))
        last = "placed"
    if kind != "yolov8":
        nodes.append(helper.make_node("Transpose", [last], ["rows"], perm=[0, 2, 1]))
        last = "rows"
    count = sum((width // stride) * (height // stride) for stride in STRIDES)
    output: list[int | str] = [1, 5, count] if kind == "yolov8" else [1, count, 6]
    return saved(file, nodes, weights, (last, output), [1, 3, height, width])


def saved(
    file: Path,
    nodes: list[Any],
    weights: list[Any],
    output: tuple[str, list[int | str]],
    shape: list[int | str],
) -> Path:
    """Write a graph with one input `picture` of this shape."""
    graph = helper.make_graph(
        nodes, "drawn", [helper.make_tensor_value_info("picture", TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info(output[0], TensorProto.FLOAT, output[1])], weights,
    )  # fmt: skip
    opset = [helper.make_opsetid("", 13)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=8), str(file))
    return file


def _cell(
    kind: Kind, stride: int, red: int, scale: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    width, height = BOX
    if kind == "yolox":
        constant = [0.5, 0.5, math.log(width / stride), math.log(height / stride), 0.0, 1.0]
    elif kind == "yolox-decoded":
        constant = [0.0, 0.0, width, height, 0.0, 1.0]
    else:
        constant = [0.0, 0.0, width, height, 0.0]
    kernel = np.zeros((len(constant), 3, stride, stride), np.float32)
    if stride == STRIDES[0]:
        kernel[4, red], kernel[4, 1] = scale / stride**2, -scale / stride**2
    # Relu follows: a negative logarithm would not pass, so the coarse grids say 1.
    return kernel, np.maximum(np.array(constant, np.float32), 0.0)


def _centres(width: int, height: int, rows: int) -> NDArray[np.float32]:
    columns = []
    for stride in STRIDES:
        y, x = np.mgrid[: height // stride, : width // stride]
        columns.append(np.stack([x.ravel(), y.ravel()]) * stride + stride / 2)
    centres = np.concatenate(columns, axis=1)
    places = np.zeros((1, rows, centres.shape[1]), np.float32)
    places[0, :2] = centres
    return places


def picture(width: int, height: int, *red: tuple[int, int, int, int]) -> NDArray[np.uint8]:
    """A grey picture with red rectangles (left, top, width, height)."""
    image = np.full((height, width, 3), GREY, np.uint8)
    for left, top, across, down in red:
        image[top : top + down, left : left + across] = RED
    return image
