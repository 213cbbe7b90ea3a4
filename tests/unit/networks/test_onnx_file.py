"""Files that people give as a model: what they are is said before anything of them is run."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from heel.schemas import SettingsError
from heel.services.networks import onnx_file
from heel.services.networks.onnx_file import read_onnx_file
from heel.services.networks.person_model import PersonModel
from tests.unit.networks.drawn_networks import picture, red_finder, saved

onnx = pytest.importorskip("onnx")


def _written(file: Path, content: bytes) -> Path:
    file.write_bytes(content)
    return file


def _torch(file: Path) -> Path:
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("archive/data.pkl", b"\x80\x02}q\x00.")
    return file


def _cut(file: Path) -> Path:
    content = red_finder(file).read_bytes()
    return _written(file, content[: len(content) // 2])


def _changed(file: Path, change: Any) -> Path:
    model = onnx.load(str(red_finder(file)))
    change(model)
    onnx.save(model, str(file))
    return file


def _no_stride(model: Any) -> None:
    strides = next(a for a in model.graph.node[0].attribute if a.name == "strides")
    strides.ints[0] = 0


def _loose_wire(model: Any) -> None:
    model.graph.node[0].input[0] = model.graph.node[2].output[0]


def _bytes_input(model: Any) -> None:
    model.graph.input[0].type.tensor_type.elem_type = onnx.TensorProto.UINT8


def _weights_of_another_length(model: Any) -> None:
    model.graph.initializer[0].dims[0] = 100_000


def _huge_weights(model: Any) -> None:
    model.graph.initializer[0].dims[0] = 1 << 40


def _two_inputs(model: Any) -> None:
    model.graph.input.append(
        onnx.helper.make_tensor_value_info("orig_target_sizes", onnx.TensorProto.INT64, [1, 2])
    )


def _channels_last(model: Any) -> None:
    dims = model.graph.input[0].type.tensor_type.shape.dim
    dims[1].dim_value, dims[3].dim_value = 64, 3


def _weights_apart(file: Path) -> Path:
    model = onnx.load(str(red_finder(file)))
    onnx.save_model(model, str(file), save_as_external_data=True, all_tensors_to_one_file=True,
                    location="net.data", size_threshold=0)  # fmt: skip
    return file


def _weights_left_behind(file: Path) -> Path:
    _weights_apart(file).with_name("net.data").unlink()
    return file


def _weights_cut_short(file: Path) -> Path:
    data = _weights_apart(file).with_name("net.data")
    data.write_bytes(data.read_bytes()[:100])
    return file


def _weights_elsewhere(file: Path) -> Path:
    model = onnx.load(str(_weights_apart(file)), load_external_data=False)
    model.graph.initializer[0].external_data[0].value = "../../etc/passwd"
    onnx.save(model, str(file))
    return file


LFS = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12\n"


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda f: _written(f, b""), "the file is empty"),
        (lambda f: _written(f, LFS), "Git LFS pointer.*git lfs pull"),
        (lambda f: _written(f, b"\n<!DOCTYPE html><html>404"), "a web page.*download the file"),
        (lambda f: _written(f, b"404: Not Found"), "a text.*404: Not Found"),
        (lambda f: _written(f, b"\x1c\0\0\0TFL3\0\0"), "TensorFlow Lite"),
        (lambda f: _written(f, b"\x80\x02}q\x00."), "pickle.*export it to ONNX"),
        (_torch, "a PyTorch file.*format=onnx"),
        (_cut, "cut short or damaged"),
        (lambda f: _written(f, bytes(range(256)) * 40), "not an ONNX network"),
        (lambda f: f.parent, "a folder"),
        (lambda f: _changed(f, _no_stride), "Conv.*strides 0.*damaged"),
        (lambda f: _changed(f, _loose_wire), "takes 'flat8', which no layer before it gives"),
        (lambda f: _changed(f, _bytes_input), "type uint8, not float"),
        (lambda f: _changed(f, _weights_of_another_length), "are not the 100000x.*damaged"),
        (lambda f: _changed(f, _huge_weights), "export it again"),
        (lambda f: _changed(f, _two_inputs), "2 inputs.*orig_target_sizes.*RT-DETR"),
        (lambda f: _changed(f, _channels_last), "channels first"),
        (_weights_left_behind, "its weights, net.data, are missing: put net.data beside it"),
        (_weights_cut_short, "net.data, are cut short"),
        (_weights_elsewhere, "not beside the file"),
    ],
)  # fmt: skip
def test_what_is_no_network_is_named_with_what_to_do(
    made: Any, message: str, tmp_path: Path
) -> None:
    file = made(tmp_path / "net.onnx")
    with pytest.raises(SettingsError, match=message) as refused:
        read_onnx_file(file)
    assert str(file) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_weights_beside_the_file_are_found(tmp_path: Path) -> None:
    model = PersonModel(_weights_apart(tmp_path / "net.onnx"))
    found = model.detect(picture(64, 64, (32, 24, 8, 8)), 0.5)
    assert len(found.boxes) == 1


@pytest.mark.parametrize(
    ("key", "text", "names"),
    [
        ("names", "{0: 'person', 1: 'car'}", ("person", "car")),
        ("names", '{"1": "car", "0": "person"}', ("person", "car")),
        ("classes", "['person', 'car']", ("person", "car")),
        ("labels", "person\ncar\n", ("person", "car")),
        ("names", "{0: 'person', 7: 'car'}", None),
        ("names", "[" * 50_000, ("[" * 50_000,)),
        ("names", "__import__('os').getcwd()", ("__import__('os').getcwd()",)),
        ("comment", "{0: 'person'}", None),
    ],
)
def test_class_names_are_read_as_exporters_write_them_and_never_run(
    key: str, text: str, names: tuple[str, ...] | None, tmp_path: Path
) -> None:
    def told(model: Any) -> None:
        onnx.helper.set_model_props(model, {key: text, "task": "detect"})

    read = read_onnx_file(_changed(tmp_path / "net.onnx", told))
    assert read.class_names == names
    assert read.task == "detect"


def test_a_damaged_copy_of_a_known_network_is_told_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = red_finder(tmp_path / "net.onnx")
    size = file.stat().st_size
    monkeypatch.setattr(onnx_file, "_KNOWN", (("net.onnx", size, "0" * 64),))
    doubt = onnx_file.doubtful(file)
    assert doubt is not None
    assert "damaged" in doubt
    monkeypatch.setattr(onnx_file, "_KNOWN", (("net.onnx", size + 1, "0" * 64),))
    assert onnx_file.doubtful(file) is None


def test_what_was_recognised_can_be_told(tmp_path: Path) -> None:
    model = PersonModel(red_finder(tmp_path / "net.onnx", "yolov8"), engine="opencv")
    assert model.description == (
        "YOLOv8 and alike, 64x64, by OpenCV; people: its only class, which the file does not name"
    )
    blank = np.zeros((64, 64, 3), np.uint8)
    assert len(model.detect(blank, 0.3).boxes) == 0


def test_two_inputs_that_are_weights_count_once(tmp_path: Path) -> None:
    node = onnx.helper.make_node("Relu", ["picture"], ["out"])
    file = saved(tmp_path / "net.onnx", [node], [], ("out", [1, 3, 64, 64]), [1, 3, 64, 64])
    assert read_onnx_file(file).width == 64
