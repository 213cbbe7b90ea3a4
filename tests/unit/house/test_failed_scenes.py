"""A scene test that fails leaves a trace and a picture behind; one that passes leaves nothing."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from heel.services.tracker.trace_file import read_trace
from tests.support import failed_scenes
from tests.unit.tracker import drawn_detections as boxes

pytest_plugins = ["pytester"]

SCENE = """
import pytest
from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from tests.support import failed_scenes
from tests.unit.tracker import drawn_detections as boxes

@pytest.mark.parametrize("right", [True, False])
def test_scene(kept_if_it_fails, right):
    people = [boxes.Person(boxes.RED, lambda t_s: (100.0 + 60.0 * t_s, 400.0))]
    boxes.follow(Tracker(TrackerSettings()), people, 1.0)
    assert right
"""


def test_only_a_test_that_fails_keeps_its_scene(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(failed_scenes, "FOLDER", tmp_path)
    pytester.makepyfile(SCENE)
    result = pytester.runpytest_inprocess("-p", "tests.support.failed_scenes", "-p", "no:timeout")
    result.assert_outcomes(passed=1, failed=1)
    assert [folder.name for folder in tmp_path.iterdir()] == ["test_scene_False_"]
    events = read_trace(tmp_path / "test_scene_False_" / "1.jsonl")
    assert [event.kind for event in events] == ["input", "confirmed"]
    picture = cv2.imread(str(tmp_path / "test_scene_False_" / "1.png"))
    assert picture is not None
    assert picture.shape == (boxes.HEIGHT, boxes.WIDTH, 3)
    assert (picture != 96).any()


def test_what_the_tracker_refused_is_kept_too(tmp_path: Path) -> None:
    frame = boxes.message([boxes.Person(boxes.RED, lambda _: (100.0, 400.0))], 0, 10.0)
    settings = TrackerSettings(preset="paper")
    failed_scenes.keep(Tracker(settings), [frame], tmp_path, 1)
    assert "preset = paper" in (tmp_path / "1.txt").read_text()
