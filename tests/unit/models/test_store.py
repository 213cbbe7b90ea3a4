"""Names, files and `none`; the network that is there; what is damaged is never used."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

import heel
from heel import api
from heel.schemas.errors import SettingsError
from heel.services.detector.settings import (
    NO_NETWORK,
    DetectorServiceSettings,
    DetectorSettings,
    NamedDetectorSettings,
)
from heel.services.models import catalogue, store
from heel.services.models.catalogue import KNOWN, KnownModel
from heel.services.models.measured import measured
from heel.services.runtime.settings import load_settings

CONTENT = b"a network"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder of models, and known networks that are nine bytes long."""
    monkeypatch.setenv(store.VARIABLE, str(tmp_path / "models"))
    (tmp_path / "models").mkdir()
    (tmp_path / "content").write_bytes(CONTENT)
    digest = store.sha256_of(tmp_path / "content")
    for name, model in list(KNOWN.items()):
        made = KnownModel(**{**vars(model), "size_bytes": len(CONTENT), "sha256": digest})
        monkeypatch.setitem(catalogue.KNOWN, name, made)
    return tmp_path / "models"


def put(folder: Path, *names: str, content: bytes = CONTENT) -> None:
    for name in names:
        (folder / KNOWN[name].file).write_bytes(content)


def in_force(*, cls: type[NamedDetectorSettings] = DetectorServiceSettings,
             **flags: object) -> NamedDetectorSettings:  # fmt: skip
    """Settings as a process loads them."""
    return load_settings("detector", cls, {"detector": flags}).service


def test_without_a_network_there_is_none_and_a_hint_with_the_command(folder: Path) -> None:
    settings = in_force()
    assert settings.model is None
    assert settings.method == "auto"
    assert settings.hint == NO_NETWORK
    assert "heel models get yolox-nano" in NO_NETWORK
    assert "\n" not in NO_NETWORK


def test_the_network_that_is_there_is_used_without_a_flag(folder: Path) -> None:
    put(folder, "person-192")
    settings = in_force(model_score=0.5)
    assert settings.model == folder / KNOWN["person-192"].file
    assert settings.method == "onnx"
    assert settings.hint is None
    put(folder, "yolox-nano")
    assert in_force().model == folder / KNOWN["yolox-nano"].file, "the better one first"
    assert in_force(detector="onnx").model == folder / KNOWN["yolox-nano"].file


@pytest.mark.parametrize(
    "flags",
    [{"model": "none"}, {"detector": "mixture"}, {"preset": "paper"}, {"detector": "mog2"}],
)
def test_what_says_otherwise_goes_without(folder: Path, flags: dict[str, str]) -> None:
    put(folder, "yolox-nano")
    settings = in_force(**flags)
    assert settings.model is None
    assert settings.hint is None


def test_what_is_scored_takes_only_what_is_named(folder: Path) -> None:
    put(folder, "yolox-nano")
    assert in_force(cls=NamedDetectorSettings).model is None
    assert DetectorSettings().model is None
    assert in_force(cls=NamedDetectorSettings, model="yolox-nano").model is not None


def test_names_files_and_paths(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(folder, "yolox-nano")
    monkeypatch.chdir(tmp_path)
    assert store.file_meant("yolox-nano") == folder / "yolox_nano.onnx"
    assert store.file_meant("./yolox-nano") == Path("yolox-nano")
    assert store.file_meant(Path("yolox-nano")) == Path("yolox-nano")
    assert store.file_meant("some/net.onnx") == Path("some/net.onnx")
    assert store.file_meant("none") is None
    (tmp_path / "plain").write_bytes(b"")
    assert store.file_meant("plain") == Path("plain")


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("yolox-nan", "did you mean 'yolox-nano'"),
        ("something", "known: yolox-nano, person-192, person-mask"),
        ("person-192", "`heel models get person-192`"),
        ("person-mask", "finds no people"),
    ],
)
def test_a_name_that_does_not_help_is_one_line(folder: Path, name: str, complaint: str) -> None:
    with pytest.raises(SettingsError, match=complaint):
        in_force(model=name)


@pytest.mark.parametrize("content", [CONTENT[:-1], b"other net"])
@pytest.mark.parametrize("flags", [{}, {"model": "yolox-nano"}])
def test_a_damaged_network_is_refused_and_not_left_out(
    folder: Path, flags: dict[str, str], content: bytes
) -> None:
    put(folder, "yolox-nano", content=content)
    with pytest.raises(SettingsError, match="`heel models get yolox-nano` brings it anew"):
        in_force(**flags)


def test_settings_for_what_moves_say_how_to_go_without_the_network(folder: Path) -> None:
    put(folder, "yolox-nano")
    with pytest.raises(SettingsError, match=r"startup_s: .* or choose --model none"):
        in_force(startup_s=9)
    assert in_force(startup_s=9, model="none").startup_s == 9


def test_the_environment_and_files_name_networks_as_flags_do(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(folder, "yolox-nano", "person-192")
    file = tmp_path / "heel.toml"
    file.write_text('[detector]\nmodel = "person-192"\n')
    loaded = load_settings("detector", DetectorServiceSettings, {}, file)
    assert loaded.service.model == folder / KNOWN["person-192"].file
    monkeypatch.setenv("HEEL_DETECTOR__MODEL", "none")
    assert load_settings("detector", DetectorServiceSettings, {}, file).service.model is None


def test_python_takes_the_network_that_is_there_and_says_what_one_would_give(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    api._warn_once.cache_clear()
    with caplog.at_level(logging.WARNING):
        heel.Tracker()
        heel.Tracker()
    assert [record.message for record in caplog.records] == [NO_NETWORK]
    api._warn_once.cache_clear()
    caplog.clear()
    put(folder, "yolox-nano")
    with pytest.raises(SettingsError, match=r"yolox_nano\.onnx: .*ONNX"):
        heel.Tracker()
    for quiet in (
        lambda: heel.Tracker(model="none"),
        lambda: heel.Tracker(detector=DetectorSettings(model="none")),
        lambda: heel.Tracker(detector=DetectorSettings(detector="ego")),
    ):
        quiet()
    assert not caplog.records


def test_the_folder_is_the_users_cache_unless_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv(store.VARIABLE)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert store.models_folder() == tmp_path / "heel" / "models"
    monkeypatch.setenv(store.VARIABLE, "~/models")
    assert store.models_folder() == Path.home() / "models"


def test_the_catalogue_is_complete() -> None:
    for name, model in KNOWN.items():
        assert name == model.name
        assert len(model.sha256) == 64
        assert model.licence == "Apache-2.0"
        assert "/" not in model.file
    assert len({model.file for model in KNOWN.values()}) == len(KNOWN)
    for model in KNOWN.values():
        assert bool(measured().lines(model)) == (model.kind == "people"), model.name


@pytest.mark.parametrize("name", KNOWN)
def test_the_known_hashes_are_those_of_the_files_at_hand(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from benchmarks.common import data_folder

    model = KNOWN[name]
    if not (data_folder() / "models" / model.file).is_file():
        pytest.skip(f"{model.file} is not in the models of HEEL_DATA")
    monkeypatch.setenv(store.VARIABLE, str(data_folder() / "models"))
    assert store.damage(model) is None
