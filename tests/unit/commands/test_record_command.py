"""`heel record` for people, `heel recorder` for units of systemd: one service."""

from __future__ import annotations

from pathlib import Path

from typer.testing import CliRunner

from heel.services.cli import app
from tests.support.recordings import info, recording, tracks


def typed(*words: object) -> str:
    done = CliRunner().invoke(app, list(map(str, words)))
    assert done.exit_code == 0, done.output
    return done.output


def test_both_names_have_the_same_settings() -> None:
    assert typed("record", "--show-config") == typed("recorder", "--show-config")
    assert '"last_s": 60.0' in typed("recorder", "--last", "60", "--show-config")
    assert "recorder " not in typed("--help"), "listed once"


def test_a_check_says_what_is_there_and_what_is_missing(tmp_path: Path) -> None:
    kept = [info(), *(tracks(seq) for seq in (0, 1, 4))]
    told = typed("record", "--check", recording(tmp_path / "a.mcap", kept)).splitlines()
    assert told[0].split() == ["topic", "messages", "per", "s", "missing", "undecodable", "MB"]
    assert told[2].split()[:4] == ["cam/front/tracks", "3", "12.5", "2"]
    assert told[-1] == "0.2 s by heel test: closed by its recorder, nothing is lost at the end"
    told = typed("record", "--check", recording(tmp_path / "b.mcap", kept, closed=False))
    assert "cut off (without an index, 0 bytes of it are left out); at most 0.25 s" in told
