"""A virtual pan as a source: its spec, its pace, and what it leaves behind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from heel.schemas.errors import SourceError
from heel.services.capture.pan_window import PanSettings
from heel.services.capture.scene_source import open_scene
from heel.services.capture.source import SourceTimeout
from heel.services.capture.sources import open_source
from heel.services.capture.virtual_pan import VirtualPanSource, parse_pan

SCENE = "scene:demo?seed=3&frames=20"


class Clock:
    """Time that passes only by waiting."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s

    def wait(self, seconds: float) -> None:
        self.now_s += seconds


def played(clock: Clock, **settings: object) -> VirtualPanSource:
    pan = PanSettings.model_validate({"width": 320, "height": 240, **settings})
    return VirtualPanSource(open_scene(SCENE), pan, "pan", clock, clock.wait)


@pytest.mark.parametrize(
    ("spec", "path", "settings"),
    [
        ("pan:walk.mp4", "walk.mp4", {}),
        ("pan:walk.mp4?width=384&height=288", "walk.mp4", {"width": 384, "height": 288}),
        (f"pan:{SCENE}?fov_deg=40", SCENE, {"fov_deg": 40.0}),
        (f"pan:{SCENE}?", SCENE, {}),
    ],
)
def test_a_spec_names_recording_and_window(
    spec: str, path: str, settings: dict[str, float]
) -> None:
    assert parse_pan(spec) == (path, PanSettings.model_validate(settings))


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("pan:/nowhere.mp4?width=384", "/nowhere.mp4"),
        ("pan:walk.mp4?widht=384", "widht='384'"),
        ("pan:walk.mp4?width=many", "width='many'"),
        ("pan:walk.mp4?fov_deg=200", "fov_deg='200'"),
        ("pan:walk.mp4?fov_deg=nan", "fov_deg='nan'"),
        ("pan:walk.mp4?oops", "key=value"),
        (f"pan:{SCENE}?width=4000", "4000x240"),
        (f"pan:{SCENE}?window_file=/nowhere/at/all.csv", "/nowhere/at/all.csv"),
        (f"pan:pan:{SCENE}??", "needs a recording"),
    ],
)
def test_what_cannot_be_panned_is_refused_in_one_line_that_names_it(spec: str, words: str) -> None:
    with pytest.raises(SourceError) as caught:
        open_source(spec)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_scale_shrinks_the_window_and_leaves_it_turnable() -> None:
    with open_source(f"pan:{SCENE}?width=320&height=240", scale=0.5) as source:
        assert source.is_live
        assert source.window is not None
        frame = source.read()
        assert frame is not None
        assert frame.image.shape == (120, 160, 3)
        assert (frame.source_width, frame.source_height) == (320, 240)


def test_frames_come_when_they_are_due_and_say_when_they_were_seen() -> None:
    clock = Clock()
    with played(clock) as source:
        times = []
        while (frame := source.read()) is not None:
            assert frame.acquired_ns is not None
            times.append(frame.acquired_ns * 1e-9 - 100.0)
    assert times == pytest.approx([index / 25.0 for index in range(20)])
    assert source.end_reason == "end of scene"


def test_a_frame_that_is_not_due_in_time_is_not_lost() -> None:
    clock = Clock()
    with played(clock) as source:
        source.read()
        with pytest.raises(SourceTimeout):
            source.read(0.01)
        assert clock.now_s == pytest.approx(100.01)
        frame = source.read()
        assert frame is not None
        assert frame.index == 1


def test_a_slow_reader_leaves_frames_out() -> None:
    clock = Clock()
    with played(clock) as source:
        source.read()
        clock.now_s += 0.3
        frame = source.read()
        assert frame is not None
        assert frame.index == 7


def test_the_window_is_cut_where_it_looks_when_the_frame_is_due(tmp_path: Path) -> None:
    clock, file = Clock(), tmp_path / "window.csv"
    whole = open_scene(SCENE).scene.frame(1)
    with played(clock, window_file=file) as source:
        source.read()
        with pytest.raises(SourceTimeout):
            source.read(0.01)
        source.window.turn(-10.0, 10.0)
        frame = source.read()
    assert frame is not None
    assert np.array_equal(frame.image, whole[120:360, 320:640])
    assert file.read_text().splitlines() == [
        "frame,left_px,top_px", "1,160.00000,120.00000", "2,320.00000,120.00000",
    ]  # fmt: skip
