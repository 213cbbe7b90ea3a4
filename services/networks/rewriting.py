"""An ONNX network made definite, so that every engine computes the same.

Dimensions that the file leaves open are fixed, 16-bit floats become 32-bit ones, and padding that
engines should work out is written out: OpenCV 5.0.0.93 takes `auto_pad=SAME_UPPER` with a stride
of 2 and an even size wrongly, without a word.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from heel.schemas.errors import SettingsError

if TYPE_CHECKING:
    from onnx import GraphProto, ModelProto, NodeProto, TensorProto

_WINDOWED = {"Conv", "ConvInteger", "QLinearConv", "MaxPool", "AveragePool", "LpPool"}
_TRANSPOSED = "ConvTranspose"
_WEIGHTS_AT = {"QLinearConv": 3}
"""Which input of a layer holds its weights, where that is not the second."""
_EXPLICIT = ("", "NOTSET")
_DAMAGED = "the file is damaged; download or export it again"


def graphs(graph: GraphProto) -> Iterator[GraphProto]:
    """A graph and those inside its nodes."""
    waiting = [graph]
    while waiting:
        one = waiting.pop()
        yield one
        for node in one.node:
            for attribute in node.attribute:
                waiting += [*attribute.graphs, *([attribute.g] if attribute.HasField("g") else [])]


def nodes(graph: GraphProto) -> Iterator[NodeProto]:
    """The nodes of a graph and of those inside them."""
    return (node for one in graphs(graph) for node in one.node)


def tensors(graph: GraphProto) -> Iterator[TensorProto]:
    """All that a graph and those inside it have as numbers, as weights or in nodes."""
    for one in graphs(graph):
        yield from one.initializer
        for node in one.node:
            for attribute in node.attribute:
                yield from attribute.tensors
                if attribute.HasField("t"):
                    yield attribute.t


def fix_input(model: ModelProto, width: int, height: int) -> None:
    """Make the input one float32 picture of this size, and forget what was said of other sizes."""
    from onnx import TensorProto

    graph = model.graph
    weights = {weight.name for weight in graph.initializer}
    kind = next(entry for entry in graph.input if entry.name not in weights).type.tensor_type
    kind.elem_type = TensorProto.FLOAT
    for side, length in zip(kind.shape.dim, (1, 3, height, width), strict=True):
        side.dim_value = length
    for one in graphs(graph):
        del one.value_info[:]
    for output in graph.output:
        for at, side in enumerate(output.type.tensor_type.shape.dim):
            side.dim_param = f"{output.name}{at}"


def without_half_floats(model: ModelProto) -> None:
    """Make all 16-bit floats 32-bit ones.

    Processors compute in 32 bits anyway, with a conversion before and after every layer.
    """
    from onnx import TensorProto, numpy_helper

    half = (TensorProto.FLOAT16, TensorProto.BFLOAT16)
    for tensor in list(tensors(model.graph)):
        if tensor.data_type in half:
            values = numpy_helper.to_array(tensor).astype(np.float32)
            tensor.CopyFrom(numpy_helper.from_array(values, tensor.name))
    for graph in graphs(model.graph):
        for entry in (*graph.input, *graph.output, *graph.value_info):
            if entry.type.tensor_type.elem_type in half:
                entry.type.tensor_type.elem_type = TensorProto.FLOAT
    for node in nodes(model.graph):
        for attribute in node.attribute:
            if attribute.name in ("to", "dtype") and attribute.i in half:
                attribute.i = TensorProto.FLOAT


def write_out_padding(model: ModelProto) -> None:
    """Replace every `auto_pad` by the padding that it stands for, as the ONNX standard defines it.

    Raises:
        SettingsError: of one the padding cannot be known before the network is run.
    """
    open_ones = [node for node in nodes(model.graph) if _auto_pad(node) not in _EXPLICIT]
    if not open_ones:
        return
    shapes = shapes_of(model)
    for node in open_ones:
        if node.op_type not in _WINDOWED and node.op_type != _TRANSPOSED:
            raise SettingsError(f"{_titled(node)} with auto_pad is not read: {_DAMAGED}")
        _write_out(node, shapes)


def _auto_pad(node: NodeProto) -> str:
    found = (one.s.decode(errors="replace") for one in node.attribute if one.name == "auto_pad")
    return next(found, "")


def _write_out(node: NodeProto, shapes: Mapping[str, Sequence[int]]) -> None:
    kind = _auto_pad(node)
    if kind not in ("VALID", "SAME_UPPER", "SAME_LOWER"):
        raise SettingsError(f"{_titled(node)} has auto_pad {kind[:40]!r}: {_DAMAGED}")
    at = _WEIGHTS_AT.get(node.op_type, 1)
    weights = shapes.get(node.input[at], ()) if len(node.input) > at else ()
    kernel = _ints(node, "kernel_shape") or list(weights[2:])
    sides = list(shapes.get(node.input[0], ())[2:]) if node.input else []
    same = kind != "VALID"
    strides = _ints(node, "strides") or [1] * len(kernel)
    dilations = _ints(node, "dilations") or [1] * len(kernel)
    added = _ints(node, "output_padding") or [0] * len(kernel)
    if not len(kernel) == len(strides) == len(dilations) == len(added):
        raise SettingsError(f"{_titled(node)} has a window of several dimensions: {_DAMAGED}")
    if not kernel or (same and (len(sides) != len(kernel) or min(sides) < 1)):
        raise SettingsError(
            f"{_titled(node)} pads itself (auto_pad {kind}) to a size that the file does not tell, "
            "which engines compute differently: export it with explicit padding"
        )
    extents = [(k - 1) * d + 1 for k, d in zip(kernel, dilations, strict=True)]
    if not same:
        totals = [0] * len(kernel)
    elif node.op_type == _TRANSPOSED:
        totals = [
            extent - stride + more
            for extent, stride, more in zip(extents, strides, added, strict=True)
        ]  # fmt: skip
    else:
        totals = [
            max(0, (-(-side // stride) - 1) * stride + extent - side)
            for side, stride, extent in zip(sides, strides, extents, strict=True)
        ]
    if min(totals) < 0 or (same and _ints(node, "output_shape")):
        raise SettingsError(
            f"{_titled(node)} pads itself (auto_pad {kind}) to a size of its own, which engines "
            "compute differently: export it with explicit padding"
        )
    less, more = [total // 2 for total in totals], [total - total // 2 for total in totals]
    _set_pads(node, [*less, *more] if kind == "SAME_UPPER" else [*more, *less], same)


def _set_pads(node: NodeProto, pads: Sequence[int], same: bool) -> None:
    from onnx import helper

    # With the same size the rounding of sizes has been used up in the padding.
    replaced = {"auto_pad", "pads"} | ({"ceil_mode"} if same else set())
    for at in reversed(range(len(node.attribute))):
        if node.attribute[at].name in replaced:
            del node.attribute[at]
    node.attribute.append(helper.make_attribute("pads", list(pads)))


def shapes_of(model: ModelProto) -> dict[str, list[int]]:
    """Of every value whose shape can be known beforehand; 0 stands for an unknown side."""
    from onnx import shape_inference

    try:
        inferred = shape_inference.infer_shapes(model, data_prop=True)
    except Exception:
        # It raises errors of several kinds over damaged files; what it cannot tell is refused.
        inferred = model
    found = {tensor.name: list(tensor.dims) for tensor in inferred.graph.initializer}
    for graph in graphs(inferred.graph):
        for entry in (*graph.input, *graph.value_info, *graph.output):
            sides = entry.type.tensor_type.shape.dim
            found.setdefault(entry.name, [side.dim_value for side in sides])
    return found


def _ints(node: NodeProto, name: str) -> list[int]:
    return next((list(one.ints) for one in node.attribute if one.name == name), [])


def _titled(node: NodeProto) -> str:
    return f"layer {(node.name or node.op_type)[:80]!r} ({node.op_type[:40]})"
