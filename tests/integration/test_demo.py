"""`heel demo`: a world, the whole stack, figures at the end, and nothing left behind."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import pytest

from tests.support.network import wait_until
from tests.support.processes import finished, running

FLAGS = ("-m", "services", "demo", "--port", "0", "--scenario", "distractor-2")


def test_it_ends_after_so_long_and_says_how_it_went(tmp_path: Path) -> None:
    pytest.importorskip("panda3d", reason="the extra sim is not installed")
    code, out, err = finished(*FLAGS, "--seconds", "8", "--out", str(tmp_path), deadline_s=60.0)
    assert code == 0, err
    assert "live page: http://127.0.0.1:" in out
    assert "followed the scenario's person" in out
    assert "people were seen in the rendered pictures" in out
    figures = json.loads((tmp_path / "following.json").read_text())
    assert figures["perception"] == "pixels"
    assert figures["time_s"] > 1.0
    assert figures["contacts"] == 0
    lines = (tmp_path / "truth.jsonl").read_text().splitlines()
    assert len(lines) > 20


def test_boxes_of_the_simulator_are_named_as_such(tmp_path: Path) -> None:
    pytest.importorskip("panda3d", reason="the extra sim is not installed")
    code, out, err = finished(
        *FLAGS, "--perception", "simulated-boxes", "--seconds", "3", "--out", str(tmp_path),
        deadline_s=60.0,
    )  # fmt: skip
    assert code == 0, err
    assert "people are the simulator's own boxes, not seen in pixels" in out
    assert json.loads((tmp_path / "following.json").read_text())["perception"] == "simulated-boxes"


def test_ctrl_c_ends_every_service(tmp_path: Path) -> None:
    pytest.importorskip("panda3d", reason="the extra sim is not installed")
    with running(*FLAGS, "--seconds", "100", "--out", str(tmp_path)) as process:
        truth = tmp_path / "truth.jsonl"
        wait_until(lambda: truth.exists() and truth.stat().st_size > 5000, "a world", 60.0)
        code, _ = process.stop(signal.SIGINT, 15.0)
        assert code == 0, process.stderr()
        assert "results in" in process.stdout()
    for log in (tmp_path / "logs").iterdir():
        assert " ends: received" in log.read_text(), f"{log.name} has not ended in order"


def test_a_scenario_that_does_not_exist_is_named(tmp_path: Path) -> None:
    code, _, err = finished(
        "-m", "services", "demo", "--port", "0", "--scenario", "moon", "--out", str(tmp_path),
        deadline_s=60.0,
    )  # fmt: skip
    assert code == 1
    assert "moon" in err
    assert "crowd" in err, "the known ones are named"
