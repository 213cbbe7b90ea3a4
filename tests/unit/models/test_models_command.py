"""`heel models`: what each verb prints, and its exit code."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from heel.schemas.errors import HeelError, SettingsError
from heel.services.cli import app
from heel.services.models import catalogue
from heel.services.models.catalogue import KNOWN
from heel.services.models.store import VARIABLE
from tests.unit.models.model_server import Behaviour, served

CONTENT = b"weights" * 1000


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    digest = hashlib.sha256(CONTENT).hexdigest()
    for name, model in list(KNOWN.items()):
        made = replace(model, size_bytes=len(CONTENT), sha256=digest)
        monkeypatch.setitem(catalogue.KNOWN, name, made)
    return tmp_path


def typed(*words: str) -> str:
    done = CliRunner().invoke(app, ["models", *words])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return done.stdout


def test_a_network_is_got_listed_found_checked_and_removed(folder: Path) -> None:
    assert typed("check").startswith("none in")
    with served(Behaviour(CONTENT)) as url:
        told = typed("get", "person-192", "--from", url)
        assert "its hash is right" in told
        assert "used by heel demo, run and detector" in told
        assert "was there already" in typed("get", "person-192")
        assert "without it they use yolox-nano" in (
            typed("get", "yolox-nano", "--from", url) and typed("get", "person-192")
        )
    listed = typed("list").splitlines()
    assert any(line.startswith("person-192") and line.endswith(" here") for line in listed)
    assert any(line.startswith("person-mask") and line.endswith("not here") for line in listed)
    for word in ("good for", "Apache-2.0", "from  ", "sha256"):
        assert sum(word in line for line in listed) == len(KNOWN)
    assert typed("path", "person-192").strip() == str(folder / "person_yolox_192.onnx")
    assert typed("check").splitlines() == ["yolox-nano  ok", "person-192  ok"]
    (folder / "person_yolox_192.onnx").write_bytes(b"damaged")
    assert "here, damaged" in typed("list")
    with pytest.raises(HeelError, match="damaged: person-192: `heel models get NAME`"):
        typed("check")
    with pytest.raises(SettingsError, match="7 bytes in place of"):
        typed("path", "person-192")
    (folder / ".person-192-0123abcd.part").write_bytes(b"rest")
    assert typed("remove", "person-192") == "person-192 removed\n"
    assert not (folder / ".person-192-0123abcd.part").exists()
    assert typed("remove", "person-192") == "person-192 was not here\n"


def test_an_unknown_name_is_one_line_with_a_near_one() -> None:
    for verb in ("get", "path", "remove"):
        with pytest.raises(SettingsError, match="did you mean 'yolox-nano'"):
            typed(verb, "yolox-nanno")
