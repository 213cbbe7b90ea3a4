"""An ONNX file before it is run: what it says of itself, and whether it is one at all.

Engines tell little of why a file cannot be used, and OpenCV ends the process over some (a stride of
0 is a division by zero). So the file is looked through first.
"""

from __future__ import annotations

import ast
import hashlib
import json
import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from heel.schemas.errors import SettingsError
from heel.services.networks.names import printable
from heel.services.networks.rewriting import (
    fix_input,
    nodes,
    tensors,
    without_half_floats,
    write_out_padding,
)

if TYPE_CHECKING:
    from onnx import AttributeProto, GraphProto, ModelProto

_MOST_SIDE_PX = 2048
"""Of the input: a larger one takes seconds a frame on a processor."""
_OPEN_SIDE_PX = 640
"""Of an input whose size a file leaves open: YOLO networks are trained at this one."""
_MOST_SIZE_CHARS = 80
"""Of a size in a file; two numbers take a tenth of it."""
_SIDE_STEP_PX = 32
"""Of sizes that a file proposes: the coarsest grid of a plain YOLO."""
_MOST_FILE_BYTES = 1 << 30
"""The largest YOLO of the families read here takes 0.3 GB."""
_MOST_NAMES_CHARS = 100_000
"""Of the class names in a file; a thousand names take a fifth of it."""
_MOST_VALUES = 1 << 31
"""Of one tensor that the file announces: 8 GB of float32 are beyond any network read here."""
_EXPORT = "export it to ONNX (for a YOLO of Ultralytics: yolo export model=FILE.pt format=onnx)"
_DOWNLOAD = "download the file itself, not the page that shows it"
_LAYOUTS: tuple[tuple[bytes, str, str], ...] = (
    (b"version https://git-lfs", "a Git LFS pointer, not the network", "run git lfs pull"),
    (b"PK\x03\x04", "a PyTorch file or another zip archive", _EXPORT),
    (b"\x80", "a pickle, as older PyTorch writes it", _EXPORT),
    (b"\x89HDF", "a Keras or HDF5 file", "export it to ONNX"),
    (b"\x1f\x8b", "a gzip archive", "unpack it"),
    (b"ftrt", "a TensorRT engine", "give the ONNX file that it was built from"),
    (b"%PDF", "a PDF", _DOWNLOAD),
)
_TFLITE = b"TFL3"
"""Identifier of a TensorFlow Lite file."""
_TFLITE_AT = 4
"""Where it stands, bytes from the start."""
_POSITIVE = {"strides", "dilations", "kernel_shape", "group", "blocksize"}
"""Attributes that are divisors or sizes."""
_KNOWN = (
    # Name, bytes, SHA-256: the one that the README names.
    ("yolox_nano.onnx", 3660092,
     "695e750a5d5754bb5a8d5325643b59282191a7e7a564e435a415fd3c578eab14"),
)  # fmt: skip
_NAME_KEYS = ("names", "classes", "class_names", "labels")


@dataclass(frozen=True)
class OnnxFile:
    """What a file says of its network.

    Attributes:
        width: of the input, pixels.
        height: of the input, pixels.
        outputs: names of its outputs.
        class_names: what its classes are called, None where it does not say.
        task: `detect`, `segment`, ..., empty where it does not say.
        network: the network for an engine, ONNX in one piece: of float32, with a fixed input and
            with padding written out.
        as_given: the same with the padding as the file has it; what engines make of `network` is
            checked against it.
    """

    width: int
    height: int
    outputs: tuple[str, ...]
    class_names: tuple[str, ...] | None
    task: str
    network: bytes = field(default=b"", repr=False)
    as_given: bytes = field(default=b"", repr=False)


def read_onnx_file(file: Path) -> OnnxFile:
    """Look a file through.

    Raises:
        SettingsError: it is missing, something else than an ONNX network, lacks its weights, has
            parts that would end the process, or wants other input than one picture.
    """
    model = _parsed(file)
    try:
        _check_weights(model, file)
        _check_nodes(model)
        told = {entry.key: entry.value for entry in model.metadata_props}
        width, height = _input_size(model, told.get("imgsz", ""))
        network, as_given = _definite(model, file, width, height)
    except SettingsError as error:
        raise SettingsError(f"model {file}: {printable(str(error))}") from None
    names = next((found for key in _NAME_KEYS if (found := _names(told.get(key, "")))), None)
    outputs = tuple(output.name for output in model.graph.output)
    return OnnxFile(width, height, outputs, names, told.get("task", ""), network, as_given)


def _definite(model: ModelProto, file: Path, width: int, height: int) -> tuple[bytes, bytes]:
    """The network in one piece, with its padding written out and as it is."""
    from onnx import external_data_helper, inliner

    external_data_helper.load_external_data_for_model(model, str(file.parent))
    if model.functions:
        model = inliner.inline_local_functions(model)
    fix_input(model, width, height)
    without_half_floats(model)
    as_given = model.SerializeToString()
    write_out_padding(model)
    return model.SerializeToString(), as_given


def _parsed(file: Path) -> ModelProto:
    if file.is_dir():
        raise SettingsError(f"model {file}: a folder; give the path of an ONNX network in it")
    if not file.is_file():
        raise SettingsError(f"model {file}: no such file; give the path of an ONNX network")
    try:
        import onnx
        from google.protobuf.message import DecodeError
    except ImportError:
        raise SettingsError(
            f"model {file}: reading a network needs the package onnx: pip install onnx"
        ) from None
    try:
        with file.open("rb") as stream:
            start = stream.read(512)
        _check_layout(start)
        if file.stat().st_size > _MOST_FILE_BYTES:
            raise SettingsError(
                f"{file.stat().st_size / 1e9:.1f} GB: no network for a robot; give a smaller one"
            )
        model = onnx.load(str(file), load_external_data=False)
    except SettingsError as error:
        raise SettingsError(f"model {file}: {error}") from None
    except OSError as error:
        raise SettingsError(f"model {file}: {error.strerror}: check the path") from None
    except (DecodeError, ValueError):
        raise SettingsError(
            f"model {file}: not an ONNX network, or cut short or damaged: {_DOWNLOAD}, or export "
            "it again"
        ) from None
    if not model.graph.node or not model.graph.output:
        raise SettingsError(
            f"model {file}: not an ONNX network: there is no layer in it; export it again"
        )
    return model


def _check_layout(start: bytes) -> None:
    """What the first bytes tell: files that people have in place of an ONNX network."""
    if not start:
        raise SettingsError("the file is empty: download or export it again")
    for magic, what, remedy in _LAYOUTS:
        if start.startswith(magic):
            raise SettingsError(f"{what}, not an ONNX network: {remedy}")
    if start[_TFLITE_AT:].startswith(_TFLITE):
        raise SettingsError("a TensorFlow Lite file, not an ONNX network: export it to ONNX")
    text = start.lstrip(b"\xef\xbb\xbf \t\r\n").lower()
    if text.startswith((b"<!doctype", b"<html", b"<head", b"<?xml", b"<!--")):
        raise SettingsError(f"a web page or XML, not an ONNX network: {_DOWNLOAD}")
    if _is_text(start):
        raise SettingsError(f"a text, not an ONNX network ({_shown(start)!r}): {_DOWNLOAD}")


def _is_text(start: bytes) -> bool:
    return all(byte in b"\t\n\r" or 32 <= byte < 127 for byte in start)


def _shown(start: bytes) -> str:
    return start.decode("ascii").split("\n", 1)[0][:40]


def _check_weights(model: ModelProto, file: Path) -> None:
    """Weights kept beside the file are there, and below its folder."""
    from onnx import TensorProto, checker

    for tensor in tensors(model.graph):
        shape = "x".join(map(str, tensor.dims))
        if min(tensor.dims, default=0) < 0 or math.prod(tensor.dims) > _MOST_VALUES:
            raise SettingsError(
                f"weights {tensor.name!r} of {shape} values: damaged, or no network for a robot; "
                "export it again"
            )
        if tensor.data_location != TensorProto.EXTERNAL:
            try:
                checker.check_tensor(tensor)
            except checker.ValidationError:
                raise SettingsError(
                    f"weights {tensor.name!r} are not the {shape} values that they should be: the "
                    "file is damaged; download or export it again"
                ) from None
            continue
        where = {entry.key: entry.value for entry in tensor.external_data}
        place = where.get("location", "")
        inside = (file.parent / place).resolve().is_relative_to(file.parent.resolve())
        if not place or not inside:
            raise SettingsError(
                f"weights in {place!r}, which is not beside the file: export it into one file"
            )
        beside = file.parent / place
        if not beside.is_file():
            raise SettingsError(
                f"its weights, {place}, are missing: put {place} beside it, or export the network "
                "into one file"
            )
        if beside.stat().st_size < _number(where, "offset") + _number(where, "length"):
            raise SettingsError(f"its weights, {place}, are cut short: copy {place} again")


def _number(where: dict[str, str], key: str) -> int:
    text = where.get(key, "0")
    return int(text) if text.isdecimal() else 0


def _check_nodes(model: ModelProto) -> None:
    for node in nodes(model.graph):
        for attribute in node.attribute:
            if attribute.name in _POSITIVE and (bad := _not_positive(attribute)) is not None:
                raise SettingsError(
                    f"layer {node.name or node.op_type!r} ({node.op_type}) has {attribute.name} "
                    f"{bad}: the file is damaged; download or export it again"
                )
    _check_wires(model.graph, set())


def _check_wires(graph: GraphProto, given: set[str]) -> None:
    """Every layer takes what an earlier one gives, as the format demands."""
    known = given | {entry.name for entry in (*graph.input, *graph.initializer)}
    known |= {entry.values.name for entry in graph.sparse_initializer}
    for node in graph.node:
        for name in node.input:
            if name and name not in known:
                raise SettingsError(
                    f"layer {node.name or node.op_type!r} takes {name[:80]!r}, which no layer "
                    "before it gives: the file is damaged; download or export it again"
                )
        for attribute in node.attribute:
            for inner in (*attribute.graphs, *([attribute.g] if attribute.HasField("g") else [])):
                _check_wires(inner, known)
        known |= set(node.output)


def _not_positive(attribute: AttributeProto) -> int | None:
    values = list(attribute.ints) or ([attribute.i] if attribute.type == attribute.INT else [])
    return next((value for value in values if value < 1), None)


def _input_size(model: ModelProto, proposed: str) -> tuple[int, int]:
    """Width and height of the one picture that it takes.

    Args:
        model: the network.
        proposed: size for a network that takes any.
    """
    from onnx import TensorProto

    weights = {weight.name for weight in model.graph.initializer}
    inputs = [entry for entry in model.graph.input if entry.name not in weights]
    if len(inputs) != 1:
        names = ", ".join(entry.name[:40] for entry in inputs[:8]) or "none"
        raise SettingsError(
            f"wants {len(inputs)} inputs ({names}), as RT-DETR and DETR of some exporters do; give "
            "a network that takes one picture, 1x3xHEIGHTxWIDTH, such as YOLOX or YOLOv8"
        )
    kind = inputs[0].type.tensor_type
    if kind.elem_type not in (TensorProto.FLOAT, TensorProto.FLOAT16):
        name = TensorProto.DataType.Name(kind.elem_type).lower() if kind.elem_type else "unknown"
        raise SettingsError(
            f"takes numbers of type {name}, not float: export it with float input, without its "
            "own preprocessing or quantisation of the input"
        )
    sides = [side.dim_value for side in kind.shape.dim]
    shape = "x".join(str(side or "?") for side in sides)
    if len(sides) != 4 or sides[1] not in (0, 3) or (sides[1] == 0 and sides[3] == 3):
        turned = len(sides) == 4 and sides[3] == 3
        remedy = (
            "export it with channels first (NCHW)" if turned
            else "give a network that takes one picture, 1x3xHEIGHTxWIDTH"
        )  # fmt: skip
        raise SettingsError(f"takes an input of {shape}; {remedy}")
    if sides[0] > 1:
        raise SettingsError(
            f"takes {sides[0]} pictures at once ({shape}): export it with a batch of one"
        )
    usual = _proposed_size(proposed)
    height, width = (side or usual[axis] for axis, side in enumerate(sides[2:]))
    if not (0 < width <= _MOST_SIDE_PX and 0 < height <= _MOST_SIDE_PX):
        raise SettingsError(
            f"input of {shape}; export it with a fixed input size of 32 to {_MOST_SIDE_PX} pixels "
            "(without dynamic axes)"
        )
    return width, height


def _proposed_size(text: str) -> tuple[int, int]:
    """Height and width that `imgsz` of the metadata proposes, `[480, 640]`; or the usual one."""
    numbers = [int(number) for number in re.findall(r"\d{1,5}", text[:_MOST_SIZE_CHARS])]
    if len(numbers) in (1, 2) and all(
        number % _SIDE_STEP_PX == 0 and 0 < number <= _MOST_SIDE_PX for number in numbers
    ):
        return numbers[0], numbers[-1]
    return _OPEN_SIDE_PX, _OPEN_SIDE_PX


def _names(text: str) -> tuple[str, ...] | None:
    """Class names from `{0: 'person', ...}`, `['person', ...]`, either as JSON, or lines."""
    if not text or len(text) > _MOST_NAMES_CHARS:
        return None
    found = _literal(text)
    if isinstance(found, dict):
        try:
            numbered = {int(number): name for number, name in found.items()}
        except (TypeError, ValueError):
            return None
        if sorted(numbered) != list(range(len(numbered))):
            return None
        found = [numbered[number] for number in range(len(numbered))]
    if not isinstance(found, list | tuple) or not all(isinstance(name, str) for name in found):
        return None
    return tuple(printable(name) for name in found) or None


def _literal(text: str) -> object:
    for read in (ast.literal_eval, json.loads):
        try:
            found: object = read(text)
        except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
            continue
        return found
    return [part.strip() for part in text.replace("\n", ",").split(",") if part.strip()]


def doubtful(file: Path) -> str | None:
    """Why a file may be a damaged copy of a known network; None where nothing says so.

    Raises:
        OSError: it cannot be read.
    """
    for name, size, digest in _KNOWN:
        if file.stat().st_size == size and hashlib.sha256(file.read_bytes()).hexdigest() != digest:
            return (
                f"as long as the {name} that the README names, but its content differs from it: "
                "damaged? Download it again, or ignore this if it is a network of your own"
            )
    return None
