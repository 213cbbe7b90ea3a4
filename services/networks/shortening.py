"""A network without what nobody reads: the same boxes of people, sooner.

Of 80 classes one is a person: the weights of the others are left out of the last layers, where they
can be told apart. And YOLOX takes every second pixel four times before its first layer; that is one
layer with a larger window and a step of 2.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from heel.services.networks.rewriting import shapes_of

if TYPE_CHECKING:
    from onnx import ModelProto, NodeProto

_ONE_BY_ONE = {"Sigmoid", "Identity", "Relu", "Exp"}
"""Layers whose every number comes of one number in the same place."""


def shortened(
    network: bytes, output: str, axis: int, columns: Sequence[int]
) -> tuple[bytes, bool]:  # fmt: skip
    """The network without what is not read, and whether the output has these columns alone now.

    It keeps all columns where it is not simple to tell which weights make them.

    Args:
        network: ONNX in one piece.
        output: the one that is read; others are left out.
        axis: of its columns.
        columns: that are read, in rising order.
    """
    kept = _of_output(network, output)
    if any(one.HasField("g") for node in kept.graph.node for one in node.attribute):
        return network, False
    alone = _Graph(kept).keep(output, axis, list(columns))
    model = kept if alone else _of_output(network, output)
    _Graph(model).fold_every_second_pixel()
    _remove_unread(model)
    return model.SerializeToString(), alone


def _of_output(network: bytes, output: str) -> ModelProto:
    from onnx import ModelProto

    model = ModelProto()
    model.ParseFromString(network)
    for at in reversed(range(len(model.graph.output))):
        if model.graph.output[at].name != output:
            del model.graph.output[at]
    _remove_unread(model)
    return model


def _remove_unread(model: ModelProto) -> None:
    """Leave out nodes and weights that nothing reads."""
    graph = model.graph
    read = {one.name for one in graph.output}
    for node in reversed(list(graph.node)):
        if read & set(node.output):
            read |= set(node.input)
        else:
            graph.node.remove(node)
    for weight in list(graph.initializer):
        if weight.name not in read:
            graph.initializer.remove(weight)


class _Graph:
    """A network while it is changed."""

    def __init__(self, model: ModelProto) -> None:
        self._graph = model.graph
        self._shapes = shapes_of(model)
        self._makers = {name: node for node in self._graph.node for name in node.output}
        self._weights = {one.name: one for one in self._graph.initializer}
        self._readers = Counter(
            [name for node in self._graph.node for name in node.input]
            + [one.name for one in self._graph.output]
        )

    def keep(self, value: str, axis: int, columns: list[int]) -> bool:
        """Make what gives this value give some of its columns; False where that is not simple."""
        node = self._makers.get(value)
        shape = self._shapes.get(value, [])
        if node is None or self._readers[value] != 1 or not 0 <= axis < len(shape):
            return False
        if columns == list(range(shape[axis])):
            return True
        if node.op_type in _ONE_BY_ONE:
            return self.keep(node.input[0], axis, columns)
        if node.op_type == "Transpose":
            order = _ints(node, "perm") or list(reversed(range(len(shape))))
            return self.keep(node.input[0], order[axis], columns)
        if node.op_type == "Concat":
            return self._keep_of_parts(node, axis, columns, len(shape))
        if node.op_type == "Reshape":
            return self._keep_reshaped(node, axis, columns, shape)
        return node.op_type == "Conv" and axis == 1 and self._keep_of_layer(node, columns)

    def _keep_of_parts(self, node: NodeProto, axis: int, columns: list[int], sides: int) -> bool:
        joined = _int(node, "axis", 0) % sides
        if joined != axis:
            return all(self.keep(part, axis, columns) for part in node.input)
        first, parts = 0, []
        for part in list(node.input):
            if len(shape := self._shapes.get(part, [])) != sides or shape[axis] < 1:
                return False
            own = [one - first for one in columns if first <= one < first + shape[axis]]
            first += shape[axis]
            if own:
                parts.append(part)
                if len(own) < shape[axis] and not self.keep(part, axis, own):
                    return False
        del node.input[:]
        node.input.extend(parts)
        return True

    def _keep_reshaped(
        self, node: NodeProto, axis: int, columns: list[int], shape: list[int]
    ) -> bool:
        """Of a picture made a row: one whose channels stay as they are."""
        before, wanted = self._shapes.get(node.input[0], []), self._constant(node.input[1])
        if axis != 1 or wanted is None or len(before) != 4 or len(shape) != 3:
            return False
        if before[:2] != shape[:2] or wanted.tolist()[1] != shape[1]:
            return False
        wanted = wanted.copy()
        wanted[1] = len(columns)
        node.input[1] = self._new(f"{node.input[1]}/{len(columns)} of {shape[1]}", wanted)
        return self.keep(node.input[0], 1, columns)

    def _keep_of_layer(self, node: NodeProto, columns: list[int]) -> bool:
        given = [self._constant(name) for name in node.input[1:]]
        if _int(node, "group", 1) != 1 or any(one is None for one in given):
            return False
        for at, values in enumerate(given, 1):
            if values is not None:
                name = f"{node.input[at]}/{len(columns)} of {len(values)} for {node.output[0]}"
                node.input[at] = self._new(name, values[columns])
        return True

    def fold_every_second_pixel(self) -> None:
        """Make one layer of four slices of every second pixel and the layer behind them."""
        for node in list(self._graph.node):
            if node.op_type != "Concat" or _int(node, "axis", 0) != 1:
                continue
            starts = [self._start(part) for part in node.input]
            sources = {start[0] for start in starts if start is not None}
            behind = [one for one in self._graph.node if node.output[0] in one.input]
            if None in starts or len(sources) != 1 or len(behind) != 1:
                continue
            (source,) = sources
            places = [start[1:] for start in starts if start is not None]
            if sorted(places) == [(0, 0), (0, 1), (1, 0), (1, 1)]:
                self._fold(behind[0], source, places)

    def _fold(self, layer: NodeProto, source: str, places: list[tuple[int, int]]) -> None:
        shape, weights = self._shapes.get(source, []), self._constant(layer.input[1])
        if layer.op_type != "Conv" or weights is None or len(shape) != 4 or weights.ndim != 4:
            return
        side, channels = weights.shape[2], shape[1]
        plain = {"group": [1], "strides": [1, 1], "dilations": [1, 1], "pads": [side // 2] * 4,
                 "kernel_shape": [side, side]}  # fmt: skip
        given = {one.name: list(one.ints) or [one.i] for one in layer.attribute}
        usual = {name: plain[name] for name in plain if name != "pads"}
        if usual | given != plain or side % 2 == 0:
            return
        if weights.shape[1] != 4 * channels or shape[2] % 2 or shape[3] % 2:
            return
        larger = np.zeros((len(weights), channels, 2 * side, 2 * side), weights.dtype)
        for part, (down, right) in enumerate(places):
            own = weights[:, part * channels : (part + 1) * channels]
            larger[:, :, down::2, right::2] = own
        layer.input[0] = source
        layer.input[1] = self._new(f"{layer.input[1]}/larger", larger)
        changed = {"strides": [2, 2], "kernel_shape": [2 * side] * 2, "pads": [side // 2 * 2] * 4}
        for one in layer.attribute:
            if one.name in changed:
                one.ints[:] = changed.pop(one.name)
        from onnx import helper

        layer.attribute.extend(helper.make_attribute(*item) for item in changed.items())

    def _start(self, value: str) -> tuple[str, int, int] | None:
        """Of slices of every second pixel: of what, and the first row and column; None: others."""
        first = {2: 0, 3: 0}
        left = {2, 3}
        while (node := self._makers.get(value)) is not None and node.op_type == "Slice":
            given = [self._constant(name) for name in node.input[1:]]
            if len(given) != 4 or any(one is None for one in given):
                return None
            starts, ends, axes, steps = (one.tolist() for one in given if one is not None)
            sides = self._shapes.get(node.input[0], [])
            if len(sides) != 4:
                return None
            for start, end, axis, step in zip(starts, ends, axes, steps, strict=True):
                whole = axis in left and end >= sides[axis]
                if not whole or step != 2 or start not in (0, 1):
                    return None
                left.remove(axis)
                first[axis] = start
            value = node.input[0]
        return None if left else (value, first[2], first[3])

    def _constant(self, name: str) -> NDArray[np.generic] | None:
        from onnx import numpy_helper

        if name in self._weights:
            return np.asarray(numpy_helper.to_array(self._weights[name]))
        node = self._makers.get(name)
        if node is not None and node.op_type == "Constant" and node.attribute[0].name == "value":
            return np.asarray(numpy_helper.to_array(node.attribute[0].t))
        return None

    def _new(self, name: str, values: NDArray[np.generic]) -> str:
        from onnx import numpy_helper

        if name not in self._weights:
            tensor = numpy_helper.from_array(values, name)
            self._graph.initializer.append(tensor)
            self._weights[name] = tensor
        return name


def _ints(node: NodeProto, name: str) -> list[int]:
    return next((list(one.ints) for one in node.attribute if one.name == name), [])


def _int(node: NodeProto, name: str, usual: int) -> int:
    return next((one.i for one in node.attribute if one.name == name), usual)
