"""`heel security`: the commands of its page, and what they say."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from heel.schemas.errors import HeelError, KeyNameError, SettingsError
from heel.services.cli import app
from tests.support.documents import blocks

pytest.importorskip("cryptography", reason="the extra `secure` is not installed")


def typed(*words: str) -> str:
    done = CliRunner().invoke(app, list(words))
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return done.stdout


def test_the_commands_of_the_page_make_a_folder_and_change_who_is_in_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("password").write_text("correct horse\n")
    said = {
        command: typed(*command.split()[1:])
        for block in blocks("sh", "docs/guides/security.md") for command in block.commands
        if command.startswith("heel security ")
    }  # fmt: skip
    assert len(said) == 10
    made = said["heel security init security --host robot.local"]
    assert "heel router --config-file security/router.json5" in made
    assert "in 730 days" in made
    shown = typed("security", "show", "security")
    assert (
        "anna          operate: look at everything, choose, drive by hand, stop and release"
        in shown
    )
    assert "gpu-detector  detector: find people in pictures" in shown
    assert "ben" not in shown
    assert (
        "role watch"
        in said["heel security login security ben --role watch --password-file password"]
    )
    accounts = Path("security/page-users").read_text().splitlines()
    assert [line.rpartition(":scrypt$")[0] for line in accounts] == [
        "operator:operate", "anna:operate",
    ]  # fmt: skip


def test_what_cannot_be_done_is_said_in_one_line(tmp_path: Path) -> None:
    folder = str(tmp_path / "keys")
    typed("security", "init", folder, "--passwords")
    for words, error, said in (
        (("init", folder), SettingsError, "is not empty"),
        (("add", folder, "anna", "--role", "king"), SettingsError, "no role 'king'"),
        (("add", folder, "An na", "--role", "watch"), KeyNameError, "An na"),
        (("remove", folder, "nobody"), SettingsError, "no 'nobody' here"),
        (("init", str(tmp_path / "other"), "--camera", "*"), KeyNameError, "--camera"),
        (("show", str(tmp_path / "other")), SettingsError, "heel security init"),
    ):
        with pytest.raises(HeelError, match=said) as caught:
            typed("security", *words)
        assert isinstance(caught.value, error)
        assert "\n" not in str(caught.value)
