"""The engines that run networks: the same numbers from each, bounded threads, errors of a line."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from benchmarks.common import data_folder
from heel.schemas import SettingsError
from heel.services.networks import engines, person_model
from heel.services.networks.engines import OpenCv, open_engine
from heel.services.networks.names import EngineName
from heel.services.networks.onnx_file import read_onnx_file
from heel.services.networks.person_model import PersonModel
from tests.unit.networks.drawn_networks import SIDE, picture, red_finder, saved

onnx = pytest.importorskip("onnx")
ort = pytest.importorskip("onnxruntime")
from onnx import helper, numpy_helper  # noqa: E402

ENGINES: list[EngineName] = ["onnxruntime", "opencv"]
PLAIN = 16
"""Side of the input of networks that are one layer."""


def golden(file: Path, blob: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """What onnxruntime makes of a file as it is, layer by layer."""
    options = ort.SessionOptions()
    options.graph_optimization_level = ort.GraphOptimizationLevel.ORT_DISABLE_ALL
    options.log_severity_level = 4
    session = ort.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])
    return np.asarray(session.run(None, {"picture": blob})[0])


def noise(side: int) -> np.ndarray[Any, Any]:
    return np.random.default_rng(5).normal(0, 1, (1, 3, side, side)).astype(np.float32)


@pytest.mark.parametrize("engine", ENGINES)
def test_engines_find_the_same_people(engine: EngineName, tmp_path: Path) -> None:
    file = red_finder(tmp_path / "net.onnx")
    image = picture(SIDE, SIDE, (32, 24, 8, 8))
    found = PersonModel(file, engine=engine).detect(image, 0.3)
    usual = PersonModel(file).detect(image, 0.3)
    assert found.boxes == pytest.approx(usual.boxes, abs=1e-3)
    assert found.scores == pytest.approx(usual.scores, abs=1e-3)


FILES = sorted((data_folder() / "models").glob("*.onnx"))


@pytest.mark.skipif(not FILES, reason="no models in HEEL_DATA")
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_known_networks_find_the_same_people_in_a_street_by_every_engine(file: Path) -> None:
    street = sorted((data_folder() / "TUD-Campus" / "img1").glob("*"))
    if not street:
        pytest.skip("no TUD-Campus in HEEL_DATA")
    image = np.asarray(cv2.imread(str(street[9])), np.uint8)
    ours, theirs = (PersonModel(file, engine=engine).detect(image, 0.3) for engine in ENGINES)
    assert len(ours.boxes) > 2
    assert ours.scores == pytest.approx(theirs.scores, abs=1e-3)
    assert ours.boxes == pytest.approx(theirs.boxes, abs=0.05)


def one_layer(
    file: Path, kind: str, weights: Sequence[Any], side: int = PLAIN, **attributes: Any
) -> Path:
    node = helper.make_node(kind, ["picture", *(one.name for one in weights)], ["out"],
                            **attributes)  # fmt: skip
    shape: list[int | str] = [1, 3, side, side]
    return saved(file, [node], list(weights), ("out", [1, "c", "h", "w"]), shape)


def kernel(*shape: int) -> Any:
    values = np.random.default_rng(6).normal(0, 1, shape).astype(np.float32)
    return numpy_helper.from_array(values, "kernel")


def widened(kernel: Any) -> Any:
    narrow = numpy_helper.to_array(kernel)
    wide = np.zeros((*narrow.shape[:2], 5, 5), np.float32)
    wide[:, :, ::2, ::2] = narrow
    return numpy_helper.from_array(wide, "kernel")


LAYERS: dict[str, tuple[str, tuple[int, ...], dict[str, Any]]] = {
    "conv": ("Conv", (4, 3, 3, 3), {}),
    "conv of 5": ("Conv", (4, 3, 5, 5), {}),
    "conv, by groups": ("Conv", (3, 1, 3, 3), {"group": 3}),
    "conv, dilated": ("Conv", (4, 3, 3, 3), {"dilations": [2, 2]}),
    "transposed conv": ("ConvTranspose", (3, 4, 3, 3), {}),
    "maximum": ("MaxPool", (), {"kernel_shape": [3, 3]}),
    "maximum, rounded up": ("MaxPool", (), {"kernel_shape": [2, 2], "ceil_mode": 1}),
    "mean": ("AveragePool", (), {"kernel_shape": [3, 3]}),
    "mean with its padding": ("AveragePool", (), {"kernel_shape": [3, 3], "count_include_pad": 1}),
}


@pytest.mark.parametrize("padding", ["SAME_UPPER", "SAME_LOWER", "VALID"])
@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("side", [8, 7])
@pytest.mark.parametrize("layer", LAYERS)
def test_padding_left_to_the_engine_is_computed_right_by_every_one(
    layer: str, side: int, stride: int, padding: str, tmp_path: Path
) -> None:
    kind, shape, more = LAYERS[layer]
    weights = [kernel(*shape)] if shape else []
    file = one_layer(
        tmp_path / "net.onnx", kind, weights, side, strides=[stride, stride], auto_pad=padding,
        **more,
    )  # fmt: skip
    blob = noise(side)
    if layer == "conv, dilated" and padding != "VALID":
        # onnxruntime refuses this one: a 3x3 kernel with gaps is a 5x5 one with zeros.
        weights, more = [widened(weights[0])], {}
    right = golden(
        one_layer(
            tmp_path / "right.onnx", kind, weights, side, strides=[stride, stride],
            auto_pad=padding, **more,
        ),
        blob,
    )  # fmt: skip
    network = read_onnx_file(file).network
    for engine in ENGINES:
        (found,) = open_engine(network, engine).run(blob, ["out"])
        assert found.shape == right.shape, engine
        assert found == pytest.approx(right, abs=1e-4), engine


def test_opencv_alone_computes_a_padding_of_its_own_wrongly(tmp_path: Path) -> None:
    """The reason for all this; when it fails, OpenCV has been mended and less is to be done."""
    file = one_layer(tmp_path / "net.onnx", "Conv", [kernel(4, 3, 3, 3)], 8, strides=[2, 2],
                     auto_pad="SAME_UPPER")  # fmt: skip
    blob = noise(8)
    (found,) = OpenCv(file.read_bytes()).run(blob, ["out"])
    assert np.abs(found - golden(file, blob)).max() > 1.0


def test_padding_to_a_size_that_is_not_known_beforehand_is_refused(tmp_path: Path) -> None:
    nodes = [
        helper.make_node("NonZero", ["picture"], ["places"]),
        helper.make_node("Cast", ["places"], ["as_floats"], to=1),
        helper.make_node("Unsqueeze", ["as_floats", "axes"], ["plane"]),
        helper.make_node("Conv", ["plane", "kernel"], ["out"], auto_pad="SAME_UPPER",
                         strides=[2, 2]),
    ]  # fmt: skip
    weights = [numpy_helper.from_array(np.array([0, 1]), "axes"), kernel(4, 1, 3, 3)]
    file = saved(tmp_path / "net.onnx", nodes, weights, ("out", [1, 4, "h", "w"]), [1, 3, 8, 8])
    with pytest.raises(SettingsError, match=r"'Conv'.*SAME_UPPER.*export it with explicit padding"):
        read_onnx_file(file)


class Wrong(OpenCv):
    """An engine with a fault."""

    def run(self, *given: Any, **named: Any) -> Any:
        return [1.03 * one for one in super().run(*given, **named)]


def test_an_engine_that_computes_something_else_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(person_model, "open_engine", lambda network, *_: Wrong(network))
    with pytest.raises(
        SettingsError, match=r"OpenCV makes other numbers of it.*model_engine"
    ) as refused:
        PersonModel(red_finder(tmp_path / "net.onnx", "yolov8"))
    assert "\n" not in str(refused.value)


@pytest.fixture
def without_onnxruntime(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (engines, person_model):
        monkeypatch.setattr(module, "onnxruntime", lambda: None)


@pytest.mark.usefixtures("without_onnxruntime")
def test_without_onnxruntime_opencv_runs_it_and_the_extra_is_named(tmp_path: Path) -> None:
    file = red_finder(tmp_path / "net.onnx")
    model = PersonModel(file)
    assert "by OpenCV" in model.description
    assert len(model.detect(picture(SIDE, SIDE, (32, 24, 8, 8)), 0.5).boxes) == 1
    with pytest.raises(SettingsError, match=r"not installed: pip install onnxruntime"):
        PersonModel(file, engine="onnxruntime")
    with pytest.raises(SettingsError, match="model_providers CUDA: it is onnxruntime's"):
        PersonModel(file, providers=["CUDA"])
    with pytest.raises(SettingsError, match="model_threads 2: it is onnxruntime's"):
        PersonModel(file, threads=2)


def test_an_unknown_provider_gets_those_that_there_are(tmp_path: Path) -> None:
    file = red_finder(tmp_path / "net.onnx")
    with pytest.raises(SettingsError, match=r"NPU3000: .* has .*CPUExecution") as no:
        PersonModel(file, providers=["NPU3000"])
    assert "\n" not in str(no.value)
    assert "Azure" not in str(no.value), "none that would send pictures away"
    assert "onnxruntime;" in PersonModel(file, providers=["cpu"]).description


SCRIPT = """
import sys, time
from pathlib import Path
import cv2
import numpy as np
from heel.schemas import SettingsError
from heel.services.networks import engines
from heel.services.networks.person_model import PersonModel
cv2.setNumThreads(1)
def threads(): return len(list(Path("/proc/self/task").iterdir()))
engines.onnxruntime()  # has one of its own from then on, which sleeps
before = threads()
model = PersonModel(Path(sys.argv[1]), engine="onnxruntime", threads=int(sys.argv[2]))
model.detect(np.zeros((64, 64, 3), np.uint8), 0.5)
time.sleep(0.3)  # a thread that has ended is listed for a moment
after = threads()
try:
    PersonModel(Path(sys.argv[3]), engine="onnxruntime")
except SettingsError as error:
    print(str(error).count("\\n"))
print(after - before, model.description)
"""


@pytest.mark.parametrize(("threads", "more"), [(1, 0), (3, 2)])
def test_threads_are_as_many_as_set_and_nothing_is_printed(
    threads: int, more: int, tmp_path: Path
) -> None:
    good = red_finder(tmp_path / "net.onnx")
    bad = one_layer(tmp_path / "bad.onnx", "NoSuchLayer", [])
    done = subprocess.run(
        [sys.executable, "-P", "-c", SCRIPT, str(good), str(threads), str(bad)],
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.stderr == ""
    said = done.stdout.splitlines()
    assert len(said) == 2
    assert said[0] == "0"
    assert said[1].startswith(f"{more} YOLOX")
    assert "onnxruntime" in said[1]


def test_runs_are_the_same_to_the_bit(tmp_path: Path) -> None:
    network = read_onnx_file(red_finder(tmp_path / "net.onnx")).network
    blob = 255 * np.abs(noise(SIDE))
    runs: list[Callable[[], Any]] = [
        lambda: open_engine(network, "onnxruntime").run(blob, ["rows"])[0] for _ in range(3)
    ]
    assert len({run().tobytes() for run in runs}) == 1
