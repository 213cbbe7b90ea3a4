"""Each setting of the detector changes what comes out, or is refused by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas import SettingsError, Tracks, encode
from heel.services.detector.core import Detector
from heel.services.detector.settings import BUILT_IN, DetectorSettings
from heel.services.tracker.core import configured
from heel.services.tracker.settings import TrackerSettings
from tests.unit.detector.drawn_scene import HEIGHT, WIDTH, background, frame_id
from tests.unit.networks.drawn_networks import red_finder

OTHER: dict[str, Any] = {
    "work_width_px": 160,
    "blur_px": 0,
    "startup_s": 0.5,
    "dissolve_ghosts": False,
    "min_blob_area_px": 600,
    "protect": False,
    "feedback_lag_frames": 9,
    "model_score": 0.95,
    "model_budget_ms": 1.0,
    "model_closer_looks": 0,
    "bridge_s": 0.0,
}
"""A value of each setting that is not its default."""
BACKGROUNDS = {"auto", "mixture", "ego", "mog2"}
REFUSED: dict[str, set[str]] = {
    "work_width_px": set(),
    "blur_px": set(),
    "startup_s": {"ego", "mog2", "onnx"},
    "dissolve_ghosts": {"mog2", "onnx"},
    "min_blob_area_px": {"mog2", "onnx"},
    "protect": {"mog2", "onnx"},
    "feedback_lag_frames": {"mog2"},
    "model_score": BACKGROUNDS,
    "model_budget_ms": BACKGROUNDS,
    "model_closer_looks": BACKGROUNDS,
    "bridge_s": BACKGROUNDS,
}
"""The methods that have no use for a setting."""
OF_THE_METHOD = {
    "preset", "detector", "options", "model", "model_near", "model_class",
    "model_head", "model_engine", "model_providers", "model_threads",
}  # fmt: skip
"""Settings that choose a method or are its own; tests of their own look at them."""
FRAMES = 36


def pictures() -> Iterator[NDArray[np.uint8]]:
    """A person leaves the place where it stood at first; another comes, walks and stands, and is as
    bright but not red in two frames; a small thing passes by, and another one stands, too small for
    a network that sees the whole frame."""
    rng = np.random.default_rng(4)
    for seq in range(FRAMES):
        image = background()
        first = 30 + 8 * max(0, seq - 12)
        stands = 250 - 4 * min(max(0, seq - 6), 20) if seq >= 6 else WIDTH
        shirt = (95, 95, 95) if seq in (31, 32) else (30, 40, 230)
        for left, top, width, height, colour in (
            (first, 50, 36, 110, (200, 60, 40)),
            (stands, 80, 44, 120, shirt),
            (5 * seq, 20, 12, 26, (20, 30, 220)),
            (72, 66, 16, 28, (20, 30, 220)),
        ):
            image[top : top + height, left : left + width] = colour
        noise = rng.normal(0, 2, image.shape)
        yield np.clip(image + noise, 0, 255).astype(np.uint8)


PICTURES = list(pictures())


def messages(settings: DetectorSettings) -> list[bytes]:
    """Every message of the detector, with the tracker behind it and a clock of 10 ms a look."""
    ticks = count()
    detector = Detector(settings, lambda: 0.01 * next(ticks))
    tracker = configured(TrackerSettings())
    tracks: list[Tracks] = []
    sent = []
    for seq, image in enumerate(PICTURES):
        lag = settings.feedback_lag_frames
        feedback = tracks[seq - lag] if seq >= lag else None
        blobs = detector.detect(frame_id(seq), image, (WIDTH, HEIGHT), feedback)
        tracks.append(tracker.update(blobs))
        sent.append(encode(blobs))
    return sent


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return red_finder(tmp_path_factory.mktemp("model") / "red.onnx")


@pytest.fixture(scope="module")
def usual(model: Path) -> Callable[[str], list[bytes]]:
    """What a method sends with default settings."""
    return cache(lambda method: messages(chosen(method, model)))


def chosen(method: str, model: Path, **changes: Any) -> DetectorSettings:
    given = {"detector": method, **changes}
    return DetectorSettings(**given, model=model if method == "onnx" else None)


def test_every_setting_is_looked_at() -> None:
    assert set(OTHER) | OF_THE_METHOD == set(DetectorSettings.model_fields)
    assert all(DetectorSettings.model_fields[name].default != OTHER[name] for name in OTHER)


@pytest.mark.parametrize("method", [one for one in BUILT_IN if one != "auto"])
@pytest.mark.parametrize("name", OTHER)
def test_a_setting_changes_what_is_sent_or_is_refused(
    method: str, name: str, model: Path, usual: Callable[[str], list[bytes]]
) -> None:
    changed = {name: OTHER[name]}
    if method in REFUSED[name]:
        with pytest.raises(SettingsError, match=f"^{name}: detector {method} does not read it"):
            chosen(method, model, **changed)
    else:
        assert messages(chosen(method, model, **changed)) != usual(method)


@pytest.mark.parametrize("name", OTHER)
def test_auto_reads_what_mixture_reads(name: str, model: Path) -> None:
    changed = {name: OTHER[name]}
    if "mixture" in REFUSED[name]:
        with pytest.raises(SettingsError, match=f"^{name}: detector auto does not read it"):
            chosen("auto", model, **changed)
    else:
        assert getattr(chosen("auto", model, **changed), name) == OTHER[name]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"model_class": 0}, "model_class: detector auto does not read it, it is for .* onnx"),
        ({"options": "a=1"}, "options: detector auto does not read it, .* other packages"),
        ({"preset": "paper", "startup_s": 1.0}, "startup_s: detector mog2 does not read it"),
        ({"detector": "mixture", "model": "x.onnx"}, "model: detector mixture does not read it"),
        ({"model_near": "x.onnx"}, "model_near: detector auto does not read it, it is for .* onnx"),
    ],
)
def test_a_setting_of_another_method_is_refused_with_the_remedy(
    settings: dict[str, Any], message: str
) -> None:
    with pytest.raises(SettingsError, match=f"{message}.*leave it out"):
        DetectorSettings.model_validate(settings)
