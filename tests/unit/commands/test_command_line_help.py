"""`heel --help` in groups, `--version`, and completion by the shell."""

from __future__ import annotations

import re

from typer.testing import CliRunner

from heel.services.cli import app


def test_every_command_stands_once_below_a_title() -> None:
    text = CliRunner().invoke(app, ["-h"], terminal_width=100).stdout
    titles = re.findall(r"^(\S.*):$", text, re.MULTILINE)
    assert titles == [
        "Options", "Run a camera, a recording or a world", "The robot", "Look into it",
        "Measure, calibrate, integrate", "One service each",
    ]  # fmt: skip
    for name in ("demo", "models", "status", "doctor", "why", "schema", "capture", "router"):
        assert len(re.findall(rf"^  {name} ", text, re.MULTILINE)) == 1, name


def test_the_version_is_printed() -> None:
    assert CliRunner().invoke(app, ["--version"]).stdout.startswith("heel ")


def test_a_shell_completes_commands_flags_and_topics() -> None:
    completed = {}
    for words in ("heel st", "heel status --wa", "heel echo est"):
        asked = {"_HEEL_COMPLETE": "complete_bash", "COMP_WORDS": words,
                 "COMP_CWORD": str(len(words.split()) - 1)}  # fmt: skip
        completed[words] = CliRunner().invoke(app, [], prog_name="heel", env=asked).stdout.split()
    assert completed == {
        "heel st": ["status", "stop"], "heel status --wa": ["--watch"], "heel echo est": ["estop"],
    }  # fmt: skip
