"""Settings: file < environment < flags, and every mistake is named in one line."""

from __future__ import annotations

import json
import re
import textwrap
import tomllib
from collections.abc import Mapping
from pathlib import Path

import pytest
from typer.testing import CliRunner

from heel.schemas.errors import SettingsError
from heel.services.capture.settings import CaptureSettings
from heel.services.cli import app
from heel.services.detector.settings import DetectorServiceSettings
from heel.services.runtime import settings as runtime_settings
from heel.services.runtime.settings import Loaded, ZenohSettings, load_settings
from heel.services.tracker.settings import TrackerServiceSettings

Flags = Mapping[str, Mapping[str, object]]


@pytest.fixture(autouse=True)
def clean_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    import os

    for name in list(os.environ):
        if name.upper().startswith("HEEL_"):
            monkeypatch.delenv(name)


def write(folder: Path, text: str) -> Path:
    file = folder / "heel.toml"
    file.write_text(text, encoding="utf-8")
    return file


def load(file: Path | None = None, flags: Flags | None = None) -> Loaded[DetectorServiceSettings]:
    return load_settings("detector", DetectorServiceSettings, flags or {}, file)


def complaint(file: Path | None = None, flags: Flags | None = None) -> str:
    with pytest.raises(SettingsError) as error:
        load(file, flags)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_defaults_stand_where_nothing_is_given() -> None:
    loaded = load()
    assert loaded.service == DetectorServiceSettings()
    assert loaded.zenoh.connect == ("tcp/127.0.0.1:7447",)
    assert loaded.log.level == "info"


def test_flags_win_over_the_environment_and_that_over_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = write(
        tmp_path,
        "[detector]\nblur_px = 3\nfeedback_lag_frames = 3\nwork_width_px = 320\n"
        '[log]\nlevel = "debug"\n',
    )
    monkeypatch.setenv("HEEL_DETECTOR__FEEDBACK_LAG_FRAMES", "4")
    monkeypatch.setenv("HEEL_DETECTOR__WORK_WIDTH_PX", "640")
    loaded = load(file, {"detector": {"work_width_px": "800"}})
    service = loaded.service
    assert (service.blur_px, service.feedback_lag_frames, service.work_width_px) == (3, 4, 800)
    assert loaded.log.level == "debug"


def test_a_preset_from_one_source_is_changed_by_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HEEL_DETECTOR__PRESET", "paper")
    loaded = load(write(tmp_path, "[detector]\nblur_px = 7\n"))
    assert (loaded.service.blur_px, loaded.service.work_width_px) == (7, 768)


def test_heel_config_names_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HEEL_CONFIG", str(write(tmp_path, "[detector]\nblur_px = 9\n")))
    assert load().service.blur_px == 9


@pytest.mark.parametrize("value", ["tcp/a:1,tcp/b:2", "tcp/a:1, tcp/b:2", '["tcp/a:1","tcp/b:2"]'])
def test_lists_in_the_environment_are_typed_as_people_type_them(
    value: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HEEL_ZENOH__CONNECT", value)
    assert load().zenoh.connect == ("tcp/a:1", "tcp/b:2")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[detector]\nblurr_px = 3\n", ["detector.blurr_px", "unknown key", "mean 'blur_px'"]),
        ("[detector]\nzzz = 3\n", ["detector.zzz", "unknown key", "known: ", "work_width_px"]),
        ("[zenoh]\nconect = []\n", ["zenoh.conect", "did you mean 'connect'"]),
        ("[log]\nlevels = 1\n", ["log.levels", "did you mean 'level'"]),
        ("[detectr]\nblur_px = 3\n", ["[detectr]", "did you mean 'detector'"]),
        ("blur_px = 3\n", ["[blur_px]", "not a table"]),
        ("detector = 3\n", ["[detector]", "not a table"]),
        ('[detector]\nblur_px = "wide"\n', ["detector.blur_px = 'wide'", "valid integer"]),
        ("[detector]\nblur_px = 99\n", ["detector.blur_px = 99", "less than or equal to 31"]),
        ("[detector]\nblur_px = 4\n", ["detector", "blur_px 4 is even"]),
        ("[detector]\nmodel_score = nan\n", ["detector.model_score = nan", "finite"]),
        ('[detector]\npreset = "fast"\n', ["detector.preset = 'fast'", "'default' or 'paper'"]),
        ('[detector]\ncamera = "*"\n', ["detector.camera = '*'", "pattern"]),
        ("[detector\n", ["not TOML", "line 1"]),
        ('[zenoh]\nuser = "robot"\n', ["user and password go together"]),
    ],
    ids=lambda value: value.replace("\n", "|").replace(" ", "") if isinstance(value, str) else "",
)  # fmt: skip
def test_mistakes_in_the_file_are_named_with_a_remedy(
    text: str, words: list[str], tmp_path: Path
) -> None:
    said = complaint(write(tmp_path, text))
    assert all(word in said for word in words), said


def test_the_example_of_the_module_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = runtime_settings.__doc__ or ""
    example = textwrap.dedent("".join(re.findall(r"^    .*\n|^\n(?=    )", text, re.MULTILINE)))
    file = write(tmp_path, example)
    tables = tomllib.loads(example)
    ((key, value),) = tables["tracker"].items()
    loaded = load_settings("tracker", TrackerServiceSettings, {}, file)
    assert getattr(loaded.service, key) == value != getattr(TrackerServiceSettings(), key)
    names = re.findall(r"`(HEEL_\w+)`", text)
    assert names == ["HEEL_ZENOH__CONNECT", f"HEEL_TRACKER__{key.upper()}"]
    monkeypatch.setenv(names[1], "3")
    assert getattr(load_settings("tracker", TrackerServiceSettings, {}, file).service, key) == 3


@pytest.mark.parametrize("table", ["replay", "run"])
def test_a_table_that_no_service_reads_is_refused(
    table: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert f"[{table}] is not a table of Heel's" in complaint(
        write(tmp_path, f"[{table}]\nanything = 1\n")
    )
    name = f"HEEL_{table.upper()}__ANYTHING"
    monkeypatch.setenv(name, "1")
    assert f"environment variable {name}: {table} is not a table" in complaint()


@pytest.mark.parametrize("table", ["DETECTOR", "ZENOH", "LOG"])
def test_a_key_of_the_environment_that_nobody_reads_is_refused(
    table: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(f"HEEL_{table}__NONSENSE", "1")
    assert f"HEEL_{table}__NONSENSE: {table.lower()}.nonsense: unknown key" in complaint()


def test_a_file_that_is_missing_or_not_text_is_named(tmp_path: Path) -> None:
    assert "nowhere.toml: No such file" in complaint(tmp_path / "nowhere.toml")
    assert "Is a directory" in complaint(tmp_path)
    binary = tmp_path / "heel.bin"
    binary.write_bytes(b"\xff\xfe\0\0")
    assert "heel.bin is not TOML" in complaint(binary)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("HEEL_DETECTOR__BLURR_PX", "3", ["detector.blurr_px", "did you mean 'blur_px'"]),
        ("HEEL_DETECTOR__BLUR_PX", "wide", ["detector.blur_px = 'wide'"]),
        ("HEEL_DETECTR__BLUR_PX", "3", ["HEEL_DETECTR__BLUR_PX", "did you mean 'detector'"]),
        ("HEEL_DETECTOR_BLUR_PX", "3", ["HEEL_DETECTOR_BLUR_PX", "HEEL_DETECTOR__BLUR_PX"]),
        ("HEEL_DETECTOR", "blur", ["detector"]),
        ("heel_detectr__blur_px", "3", ["heel_detectr__blur_px"]),
    ],
)
def test_mistakes_in_the_environment_are_named_with_a_remedy(
    name: str, value: str, words: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(name, value)
    said = complaint()
    assert all(word in said for word in words), said


@pytest.mark.parametrize(
    "name", ["HEEL_SOURCE", "HEEL_DATA", "HEEL_PARENT_PID", "HEEL_TRACKER__PRESET", "HEELS__X"]
)
def test_variables_of_others_are_left_alone(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(name, "paper")
    assert load().service == DetectorServiceSettings()


def test_mistakes_in_flags_are_named_like_those_in_files() -> None:
    assert "detector.blur_px = 'wide'" in complaint(flags={"detector": {"blur_px": "wide"}})


def test_settings_are_immutable() -> None:
    with pytest.raises(ValueError, match="frozen"):
        load().service.blur_px = 3  # type: ignore[misc]


def test_secrets_are_hidden_when_settings_are_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HEEL_ZENOH__PASSWORD", "hunter2")
    file = write(
        tmp_path,
        '[zenoh]\nuser = "robot"\n[capture]\nsource = "rtsp://admin:hunter2@10.0.0.7:554/live"\n',
    )
    loaded = load_settings("capture", CaptureSettings, {}, file)
    assert loaded.zenoh.password is not None
    assert loaded.zenoh.password.get_secret_value() == "hunter2"
    assert loaded.service.source == "rtsp://admin:hunter2@10.0.0.7:554/live"
    shown = json.dumps(loaded.shown("capture"))
    assert "hunter2" not in shown + str(loaded.zenoh)
    assert "rtsp://***@10.0.0.7:554/live" in shown
    assert '"user": "robot"' in shown


@pytest.mark.parametrize("text", ["password = 5432167", 'password = ["hunter5432167"]'])
def test_secrets_are_hidden_when_they_are_mistyped(text: str, tmp_path: Path) -> None:
    said = complaint(write(tmp_path, f'[zenoh]\nuser = "robot"\n{text}\n'))
    assert "zenoh.password" in said
    assert "5432167" not in said


def test_shown_settings_are_what_a_file_would_hold(tmp_path: Path) -> None:
    loaded = load_settings("tracker", TrackerServiceSettings, {"tracker": {"camera": "rear"}})
    assert loaded.shown("tracker").keys() == {"tracker", "zenoh", "log"}
    assert loaded.shown("tracker")["tracker"]["camera"] == "rear"


def test_a_password_may_stand_in_a_file(tmp_path: Path) -> None:
    file = tmp_path / "password"
    file.write_text("hunter2\n")
    assert ZenohSettings(user="robot", password_file=file).secret() == "hunter2"
    file.write_text("\n")
    with pytest.raises(SettingsError, match="is empty"):
        ZenohSettings(user="robot", password_file=file).secret()
    with pytest.raises(SettingsError, match="No such file"):
        ZenohSettings(user="robot", password_file=tmp_path / "none").secret()


@pytest.mark.parametrize(
    "given",
    [
        {"password_file": Path("p")},
        {"user": "robot", "password_file": Path("p"), "password": "hunter2"},
    ],
)
def test_a_user_has_one_password(given: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="go together"):
        ZenohSettings(**given)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[web]\nprot = 8000\n", r"web\.prot: unknown key; did you mean 'port'"),
        ("[drive]\nmax_linear = 1\n", r"drive\.max_linear: unknown key"),
        ("[replay]\nfoo = 1\n", r"\[replay\] is not a table of Heel's"),
    ],
)
def test_unknown_keys_are_refused_in_the_tables_of_other_services_too(
    tmp_path: Path, text: str, told: str
) -> None:
    file = tmp_path / "heel.toml"
    file.write_text(text)
    done = CliRunner().invoke(app, ["tracker", "--config", str(file), "--show-config"])
    assert isinstance(done.exception, SettingsError)
    assert re.search(told, str(done.exception)), done.exception
