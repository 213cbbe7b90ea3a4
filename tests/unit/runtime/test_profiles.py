"""Profiles: settings for a kind of computer, below a user's own."""

from __future__ import annotations

from pathlib import Path

import pytest

import heel.services.cli  # noqa: F401  (tells which tables there are)
from heel.schemas.errors import SettingsError
from heel.services.capture.settings import CaptureSettings
from heel.services.detector.settings import DetectorServiceSettings
from heel.services.runtime.settings import PROFILE, known_tables, load_settings, profile_tables


def capture(**flags: object) -> CaptureSettings:
    loaded = load_settings("capture", CaptureSettings, {"capture": flags}, profile="pi")
    return loaded.service


def test_a_profile_is_below_file_environment_and_flags(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert (capture().camera_width, capture().camera_height) == (640, 480)
    assert capture(camera_width=320).camera_width == 320
    monkeypatch.setenv("HEEL_CAPTURE__CAMERA_WIDTH", "800")
    assert (capture().camera_width, capture().camera_height) == (800, 480)
    file = tmp_path / "heel.toml"
    file.write_text("[capture]\ncamera_height = 600\n")
    loaded = load_settings("capture", CaptureSettings, {}, file, "pi").service
    assert (loaded.camera_width, loaded.camera_height) == (800, 600)


def test_the_variable_names_it_for_all_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(PROFILE, "pi")
    assert load_settings("capture", CaptureSettings, {}).service.camera_width == 640


def test_a_profile_that_does_not_exist_is_named() -> None:
    for name in ("pie", "../pi"):
        with pytest.raises(SettingsError, match=r"no profile .*: there is pi"):
            load_settings("capture", CaptureSettings, {}, profile=name)


def test_without_its_network_the_profile_says_how_to_get_it() -> None:
    with pytest.raises(SettingsError, match="`heel models get person-192`"):
        load_settings("detector", DetectorServiceSettings, {}, profile="pi")
    flags = {"detector": {"model": "none"}}
    assert load_settings("detector", DetectorServiceSettings, flags, profile="pi")


def test_every_key_of_a_profile_is_a_setting() -> None:
    for table, keys in profile_tables("pi").items():
        assert set(keys) <= set(known_tables()[table].model_fields)
