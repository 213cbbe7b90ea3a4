"""`heel scenarios` from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from heel.schemas import HeelError
from heel.services.cli import app

SHORT = ["scenarios", "--episodes", "1", "--jobs", "1", "--scenario", "straight", "--seed", "3"]


def test_json_and_a_picture_of_an_episode(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, [*SHORT, "--json", "--out", str(tmp_path)])

    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert (report["episodes"], report["mode"], report["seed"]) == (1, "simulated boxes", 3)
    assert report["scenarios"] == {"straight": report["overall"]}
    assert (tmp_path / "straight-3.png").read_bytes().startswith(b"\x89PNG")
    line = json.loads((tmp_path / "episodes.jsonl").read_text())
    assert (line["scenario"], line["seed"]) == ("straight", 3)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["scenarios", "--scenario", "moonwalk"], "no scenario 'moonwalk'"),
        (["scenarios", "--processes", "--pixels"], "leave out --pixels"),
        (["scenarios", "--model", "net.onnx"], "add --pixels"),
        ([*SHORT, "--pixels", "--model", "no.onnx"], "no.onnx: no such file"),
        ([*SHORT, "--video"], "give --out DIR"),
    ],
)
def test_wrong_usage_is_said(arguments: list[str], says: str) -> None:
    result = CliRunner().invoke(app, arguments)

    assert isinstance(result.exception, HeelError)
    assert says in str(result.exception)
