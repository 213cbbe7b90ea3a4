"""The detector that runs a network: whole frames, closer looks, its messages, its time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from heel.schemas import Blobs, SettingsError, encode
from heel.schemas.blobs import MAX_BLOBS
from heel.services.detector import interface
from heel.services.detector.core import Detector
from heel.services.detector.interface import Frame
from heel.services.detector.messages import person_blobs
from heel.services.detector.settings import DetectorSettings
from tests.unit.detector.drawn_scene import frame_id
from tests.unit.networks.drawn_networks import picture, red_finder

pytest.importorskip("onnx")
SIZE = (320, 240)
CELL = 40
"""Frame pixels of a cell of the network in a whole frame of this size."""


@pytest.fixture
def model(tmp_path: Path) -> Path:
    return red_finder(tmp_path / "net.onnx")


def play(
    settings: DetectorSettings, *red: tuple[int, int, int, int], frames: int = 1,
    clock: Callable[[], float] | None = None,
) -> list[Blobs]:  # fmt: skip
    detector = Detector(settings, clock)
    image = picture(*SIZE, *red)
    return [detector.detect(frame_id(seq), image, SIZE, None) for seq in range(frames)]


def test_a_person_is_a_blob_with_a_score_and_the_pixels_under_the_box(model: Path) -> None:
    message = play(DetectorSettings(detector="onnx", model=model), (160, 80, CELL, CELL))[0]
    assert (message.kind, message.detector, len(message.blobs)) == ("people", "onnx", 1)
    blob = message.blobs[0]
    assert blob.score == pytest.approx(1.0)
    assert blob.box_xyxy == pytest.approx((120, 0, 240, 220), abs=1)
    middle = blob.patch.array()[blob.patch.height * 100 // 220, blob.patch.width // 2]
    assert middle.tolist() == [0, 0, 255]


def test_auto_uses_the_model_where_one_is_given(model: Path) -> None:
    assert play(DetectorSettings(model=model))[0].detector == "onnx"


@pytest.mark.parametrize("name", ["mixture", "mog2", "ego"])
def test_a_background_takes_no_model(name: str, model: Path) -> None:
    with pytest.raises(SettingsError, match=f"model: detector {name} does not read it"):
        DetectorSettings(detector=name, model=model)


def test_the_network_without_a_model_asks_for_one() -> None:
    with pytest.raises(SettingsError, match="needs a network: `heel models get yolox-nano`"):
        Detector(DetectorSettings(detector="onnx"))


def test_a_crowd_fits_into_a_message(model: Path) -> None:
    image = np.random.default_rng(1).integers(0, 256, (900, 1600, 3)).astype(np.uint8)
    crowd = [((8.0 * k, 100.0, 8.0 * k + 300.0, 800.0), 0.5) for k in range(MAX_BLOBS)]
    empty = play(DetectorSettings(model=model))[0]
    message = empty.model_copy(update={"blobs": tuple(person_blobs(crowd, image))})
    assert len(encode(message)) < Blobs.max_bytes
    assert min(blob.patch.height for blob in message.blobs) > 30


def test_what_is_too_small_for_the_whole_frame_is_found_by_a_closer_look(model: Path) -> None:
    small = (142, 62, 16, 16)
    blind = DetectorSettings(model=model, model_closer_looks=0)
    assert not any(message.blobs for message in play(blind, small, frames=12))
    looking = play(DetectorSettings(model=model), small, frames=12)
    boxes = [blob.box_xyxy for message in looking for blob in message.blobs]
    assert boxes
    for left, top, right, bottom in boxes:
        assert left < 150 < right
        assert top < 70 < bottom


def test_what_is_found_does_not_depend_on_the_time_without_a_clock(model: Path) -> None:
    free = DetectorSettings(model=model)
    bound = DetectorSettings(model=model, model_budget_ms=0.001)
    red = (160, 80, CELL, CELL)
    assert play(bound, red, frames=6) == play(free, red, frames=6)


def test_a_budget_that_is_spent_skips_frames(model: Path) -> None:
    now_s = 0.0

    def slow() -> float:
        nonlocal now_s
        now_s += 0.05
        return now_s

    settings = DetectorSettings(model=model, model_budget_ms=10, model_closer_looks=0)
    seen = play(settings, (160, 80, CELL, CELL), frames=50, clock=slow)
    looked = [seq for seq, message in enumerate(seen) if message.blobs]
    assert looked[0] == 0
    assert 8 <= len(looked) <= 11


@pytest.fixture
def near(tmp_path: Path) -> Path:
    """A network that sees a quarter as much, and takes what is red for twice as large."""
    return red_finder(tmp_path / "near.onnx", width=32, height=32)


def test_of_two_networks_the_smaller_sees_every_frame_and_the_other_eight_a_second(
    model: Path, near: Path
) -> None:
    settings = DetectorSettings(model=model, model_near=near)
    seen = play(settings, (160, 80, 80, 80), frames=24)
    widths = [max(right - left for left, _, right, _ in boxes_of(message)) for message in seen]
    whole = [seq for seq, width in enumerate(widths) if width < 200]
    assert frame_id(2).t_capture_ns >= 120_000_000 > frame_id(1).t_capture_ns
    assert whole == list(range(0, 24, 2))


def test_two_networks_find_the_same_whatever_the_clock_says_without_a_budget(
    model: Path, near: Path
) -> None:
    settings = DetectorSettings(model=model, model_near=near)
    red = (142, 62, 16, 16)
    ticks = iter(np.geomspace(1.0, 1e6, 5000))
    timed = play(settings, red, frames=12, clock=lambda: float(next(ticks)))
    assert timed == play(settings, red, frames=12)


def boxes_of(message: Blobs) -> list[tuple[float, float, float, float]]:
    return [blob.box_xyxy for blob in message.blobs]


class Nobody:
    """What a package of one's own would add."""

    def __init__(self, settings: DetectorSettings) -> None:
        self.settings = settings

    def detect(self, frame: Frame) -> Blobs:
        height, width = np.shape(frame.image)[:2]
        return Blobs(
            **frame.id.model_dump(), width=width, height=height, source_width=width,
            source_height=height, detector=self.settings.detector,
        )  # fmt: skip


class Added:
    name, value = "nobody", "own_package:Nobody"

    def load(self) -> type[Nobody]:
        return Nobody


class Broken(Added):
    name = "broken"

    def load(self) -> type[Nobody]:
        raise ImportError("no module named 'own_package'")


@pytest.fixture
def added(monkeypatch: pytest.MonkeyPatch) -> None:
    def entries(group: str) -> list[Added]:
        return [Added(), Broken()] if group == "heel.detectors" else []

    monkeypatch.setattr(interface, "entry_points", entries)


@pytest.mark.usefixtures("added")
def test_a_package_adds_a_detector_by_an_entry_point() -> None:
    assert play(DetectorSettings(detector="nobody"))[0].detector == "nobody"


@pytest.mark.usefixtures("added")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nobodi", "use one of auto, broken, ego, mixture, mog2, nobody, onnx"),
        ("broken", "own_package"),
    ],
)
def test_a_detector_that_is_not_there_is_named(name: str, message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        Detector(DetectorSettings(detector=name))


def test_engine_providers_threads_and_head_are_those_of_the_settings(
    model: Path, caplog: pytest.LogCaptureFixture
) -> None:
    pytest.importorskip("onnxruntime")
    with caplog.at_level("INFO", "heel.detector"):
        Detector(DetectorSettings(model=model, model_engine="opencv"))
        Detector(DetectorSettings(model=model, model_engine="onnxruntime", model_threads=2))
    said = [record.getMessage() for record in caplog.records if "network" in record.getMessage()]
    assert "by OpenCV" in said[0]
    assert "by onnxruntime" in said[1]
    for given, message in (
        ({"model_providers": "NPU3000"}, "model_providers NPU3000: this onnxruntime has"),
        ({"model_engine": "opencv", "model_threads": 2}, "model_threads 2: it is onnxruntime's"),
        ({"model_head": "yolov10"}, "its 6 columns are not those of yolov10"),
    ):
        with pytest.raises(SettingsError, match=message):
            Detector(DetectorSettings.model_validate({"model": model, **given}))
