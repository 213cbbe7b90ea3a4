"""The example plug-in: found by its entry point, with options of its own."""

from __future__ import annotations

import json
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from heel.schemas import SettingsError
from heel.services.detector import interface
from heel.services.detector.core import Detector
from heel.services.detector.settings import DetectorServiceSettings, DetectorSettings
from heel.services.runtime.command_line import settings_command
from heel.services.runtime.settings import load_settings
from tests.unit.detector.drawn_scene import frame_id

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


@pytest.fixture(autouse=True)
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """As after `pip install ./examples`."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    added = EntryPoint("red", "red_detector:RedDetector", interface.GROUP)
    monkeypatch.setattr(interface, "entry_points", lambda group: [added])


def shown(*arguments: str) -> dict[str, Any]:
    """What `heel detector --show-config` prints with these arguments."""
    app = typer.Typer()
    app.command()(settings_command("detector", DetectorServiceSettings, lambda _: 0, "Detect."))
    ran = CliRunner().invoke(app, [*arguments, "--show-config"], catch_exceptions=False)
    settings: dict[str, Any] = json.loads(ran.stdout)["detector"]
    return settings


def test_the_example_is_packaged_under_its_name() -> None:
    assert 'red = "red_detector:RedDetector"' in (EXAMPLES / "pyproject.toml").read_text()


@pytest.mark.parametrize(("options", "found"), [({}, 1), ({"redness": 200}, 0)])
def test_an_option_reaches_the_plug_in(options: dict[str, object], found: int) -> None:
    image = np.full((120, 160, 3), 60, np.uint8)
    image[20:100, 50:80] = (40, 40, 180)
    detector = Detector(DetectorSettings(detector="red", options=options))
    blobs = detector.detect(frame_id(0), image, (160, 120), None)
    assert (blobs.detector, blobs.kind, len(blobs.blobs)) == ("red", "people", found)
    if found:
        assert blobs.blobs[0].box_xyxy == (50.0, 20.0, 80.0, 100.0)


@pytest.mark.parametrize("source", ["flag", "environment", "file"])
def test_options_come_from_flags_environment_and_file_and_are_shown_with_defaults(
    source: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["--detector", "red"]
    if source == "flag":
        arguments += ["--options", "least_px=7"]
    if source == "environment":
        monkeypatch.setenv("HEEL_DETECTOR__OPTIONS__LEAST_PX", "7")
    if source == "file":
        file = tmp_path / "heel.toml"
        file.write_text("[detector.options]\nleast_px = 7\n")
        arguments += ["--config", str(file)]
    assert shown(*arguments)["options"] == {"redness": 80, "least_px": 7}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rednes": 1}, ["options.rednes", "redness [default: 80]", "grey levels", "least_px"]),
        ({"redness": 0}, ["options.redness = 0", "greater than or equal to 1", "default: 80"]),
        ({"redness": "very"}, ["options.redness = 'very'", "integer"]),
        ("redness", ["options 'redness'", "NAME=VALUE"]),
    ],
)
def test_wrong_options_are_refused_with_the_list(options: object, words: list[str]) -> None:
    with pytest.raises(SettingsError) as refused:
        load_settings(
            "detector",
            DetectorServiceSettings,
            {"detector": {"detector": "red", "options": options}},
        )
    assert all(word in str(refused.value) for word in words)
