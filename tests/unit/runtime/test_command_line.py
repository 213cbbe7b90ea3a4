"""Flags made from a settings model: help, values, errors, exit codes."""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path
from typing import Literal

import pytest
import typer
from pydantic import Field
from typer.testing import CliRunner, Result

from heel.schemas.errors import HeelError, SettingsError
from heel.services.runtime.command_line import hide_password, run_app, settings_command
from heel.services.runtime.settings import Endpoints, Loaded, StrictSettings


class Sample(StrictSettings):
    """One field of every kind."""

    what: str = Field("walk", description="the argument", json_schema_extra={"positional": True})
    speed_mps: float = Field(0.5, ge=0, le=2, description="how fast")
    frames: int | None = Field(None, ge=1, description="how many")
    loop: bool = Field(False, description="again and again")
    pace: Literal["live", "lossless"] = Field("live", description="which way")
    names: Endpoints = Field(("a", "b"), description="who")


class Outcome:
    """What the command was run with, and the exit code it gives."""

    loaded: Loaded[Sample]
    code = 0

    def run(self, loaded: Loaded[Sample]) -> int:
        self.loaded = loaded
        return self.code


@pytest.fixture
def outcome() -> Outcome:
    return Outcome()


def call(outcome: Outcome, *arguments: str) -> Result:
    # A table that files may hold.
    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.command()(settings_command("drive", Sample, outcome.run, "Sample command."))
    return CliRunner().invoke(app, list(arguments), env={"COLUMNS": "200"})


def test_help_shows_every_setting_with_its_description_and_default(outcome: Outcome) -> None:
    text = re.sub(r"\s+", " ", call(outcome, "--help").output)
    assert "Sample command." in text
    for words in (
        "how fast [default: 0.5]", "which way [default: live]", "who [default: a,b]",
        "again and again [default: False]", "how many", "the argument [default: walk]",
        "--loop / --no-loop", "live|lossless", "--log-level debug|info|warning|error",
        "--speed-mps NUMBER", "--frames NUMBER", "--connect", "--show-config", "--config FILE",
    ):  # fmt: skip
        assert words in text, words


def test_help_shows_no_default_for_settings_without_one(outcome: Outcome) -> None:
    text = re.sub(r"\s+", " ", call(outcome, "--help").output)
    assert re.search(r"how many(?! \[default)", text)
    assert "None" not in text


def test_flags_reach_the_command_and_the_rest_keeps_its_default(outcome: Outcome) -> None:
    done = call(
        outcome, "run", "--speed-mps", "1.5", "--loop", "--names", "x, y", "--log-level", "error",
        "--connect", "tcp/a:1",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    assert outcome.loaded.service == Sample(what="run", speed_mps=1.5, loop=True, names=("x", "y"))
    assert outcome.loaded.log.level == "error"
    assert outcome.loaded.zenoh.connect == ("tcp/a:1",)


def test_flags_that_are_not_given_leave_the_file_in_force(outcome: Outcome, tmp_path: Path) -> None:
    file = tmp_path / "heel.toml"
    file.write_text("[drive]\nloop = true\nspeed_mps = 1.0\n")
    call(outcome, "--config", str(file), "--speed-mps", "2")
    assert (outcome.loaded.service.loop, outcome.loaded.service.speed_mps) == (True, 2.0)
    call(outcome, "--config", str(file), "--no-loop")
    assert outcome.loaded.service.loop is False


@pytest.mark.parametrize("code", [0, 1, 2])
def test_the_exit_code_is_that_of_the_service(code: int, outcome: Outcome) -> None:
    outcome.code = code
    assert call(outcome).exit_code == code


def test_show_config_prints_settings_and_runs_nothing(outcome: Outcome) -> None:
    done = call(outcome, "--show-config", "--user", "robot", "--password", "hunter2")
    assert done.exit_code == 0
    assert not hasattr(outcome, "loaded")
    assert "hunter2" not in done.output
    assert json.loads(done.output)["drive"]["speed_mps"] == 0.5


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--speed-mps", "fast"], "drive.speed_mps = 'fast'"),
        (["--speed-mps", "9"], "less than or equal to 2"),
        (["--pace", "slow"], "drive.pace = 'slow'"),
        (["--frames", "0"], "greater than or equal to 1"),
        (["--names", " , "], "names nothing between its commas"),
        (["--config", "/nowhere.toml"], "/nowhere.toml"),
    ],
)
def test_bad_values_are_settings_errors_with_the_name(
    arguments: list[str], words: str, outcome: Outcome
) -> None:
    error = call(outcome, *arguments).exception
    assert isinstance(error, SettingsError)
    assert words in str(error)


@pytest.mark.parametrize(
    ("error", "code"), [(HeelError("no router"), 1), (SettingsError("no such key"), 2)]
)
def test_heel_errors_become_one_line_and_an_exit_code(
    error: HeelError, code: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    app = typer.Typer(add_completion=False)

    @app.command()
    def fail() -> None:
        raise error

    monkeypatch.setattr("sys.argv", ["heel"])
    with pytest.raises(SystemExit) as ended:
        run_app(app)
    assert ended.value.code == code
    assert capsys.readouterr().err == f"heel: {error}\n"


@pytest.mark.parametrize(
    ("typed", "kept", "password"),
    [
        (["heel", "web", "--user", "u", "--password", "s3cret"],
         ["heel", "web", "--user", "u"], "s3cret"),
        (["-m", "heel", "web", "--password=s3c=ret", "--port", "1"],
         ["-m", "heel", "web", "--port", "1"], "s3c=ret"),
    ],
)  # fmt: skip
def test_a_password_leaves_the_command_line(
    typed: list[str], kept: list[str], password: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[list[str]] = []
    monkeypatch.setattr(sys, "orig_argv", ["python", *typed])
    monkeypatch.setattr(os, "execv", lambda _program, argv: started.append(argv))
    monkeypatch.delenv("HEEL_ZENOH__PASSWORD", raising=False)
    monkeypatch.setenv("HEEL_ZENOH__PASSWORD", "another")
    hide_password()
    assert started == [[sys.executable, *kept]]
    assert os.environ["HEEL_ZENOH__PASSWORD"] == password


@pytest.mark.parametrize("typed", [["heel", "web"], ["heel", "web", "--password"]])
def test_without_a_password_nothing_is_started_anew(
    typed: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "orig_argv", ["python", *typed])
    monkeypatch.setattr(os, "execv", lambda *_: pytest.fail("started anew"))
    hide_password()
