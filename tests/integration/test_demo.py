"""`heel demo`: a world, the whole stack, figures at the end, and nothing left behind."""

from __future__ import annotations

import json
import os
import re
import signal
import time
from contextlib import suppress
from pathlib import Path

import pytest

from heel.schemas import EndOfStream, encode
from heel.services.detector.settings import NO_NETWORK
from tests.support.network import client, wait_until
from tests.support.processes import finished, running

FLAGS = ("-m", "heel", "demo", "--port", "0", "--scenario", "distractor-2")


def test_it_ends_after_so_long_and_says_how_it_went(tmp_path: Path) -> None:
    pytest.importorskip("panda3d", reason="the extra sim is not installed")
    code, out, err = finished(*FLAGS, "--seconds", "8", "--out", str(tmp_path), deadline_s=60.0)
    assert code == 0, err
    assert "live page: http://127.0.0.1:" in out
    assert "followed the scenario's person" in out
    assert err.count(NO_NETWORK) == 1, "what a network gives, and how to get one"
    assert NO_NETWORK in (tmp_path / "logs" / "detector.log").read_text()
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
    code, out, err = finished(
        "-m", "heel", "demo", "--port", "0", "--scenario", "moon", "--out", str(tmp_path),
        deadline_s=60.0,
    )  # fmt: skip
    assert code == 2
    assert "moon" in err
    assert "crowd" in err, "the known ones are named"
    assert out == "", "nothing was started"
    assert not list(tmp_path.iterdir())


def test_a_network_that_cannot_be_used_is_named_before_anything_starts(tmp_path: Path) -> None:
    pytest.importorskip("panda3d", reason="the extra sim is not installed")
    code, out, err = finished(
        *FLAGS, "--model", str(tmp_path / "none.onnx"), "--out", str(tmp_path), deadline_s=60.0
    )
    assert (code, out) == (2, "")
    assert "none.onnx" in err
    assert not list(tmp_path.iterdir())


_STATE_S = 1.2
"""A tracker writes down once a second what it knows of people."""
BOXES = (*FLAGS, "--perception", "simulated-boxes", "--seconds", "60")


def _log_says(out: Path, service: str, words: str) -> None:
    log = out / "logs" / f"{service}.log"
    wait_until(lambda: log.exists() and words in log.read_text(), f"{service}: {words}", 60.0)


def _pid_of(out: Path, service: str) -> int:
    """The process whose standard error is this log."""
    log = str(out / "logs" / f"{service}.log")
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if os.readlink(entry / "fd" / "2") == log:
                return int(entry.name)
    raise AssertionError(f"no process writes {log}")


def test_a_service_that_ends_in_order_ends_the_demo_with_its_name(tmp_path: Path) -> None:
    pytest.importorskip("panda3d", reason="the extra sim is not installed")
    with running(*BOXES, "--out", str(tmp_path)) as process:
        _log_says(tmp_path, "simulator", "episode")
        os.kill(_pid_of(tmp_path, "tracker"), signal.SIGTERM)
        assert process.wait(15.0) == 1
        lines = process.stderr().strip().splitlines()
        assert len(lines) == 1
        assert "tracker ended" in lines[0]


def test_services_that_are_killed_or_frozen_come_back_and_nothing_of_them_stays(
    tmp_path: Path,
) -> None:
    pytest.importorskip("panda3d", reason="the extra sim is not installed")
    with running(*BOXES, "--out", str(tmp_path)) as process:
        log = tmp_path / "logs" / "follower.log"
        chosen = re.compile(r"\(target [0-9]+\)")
        wait_until(lambda: log.exists() and chosen.search(log.read_text()), "a target", 60.0)
        _log_says(tmp_path, "tracker", "is up")
        time.sleep(_STATE_S)
        before = chosen.findall(log.read_text())
        killed, frozen = _pid_of(tmp_path, "tracker"), _pid_of(tmp_path, "follower")
        os.kill(killed, signal.SIGKILL)
        os.kill(frozen, signal.SIGSTOP)
        trackers = tmp_path / "logs" / "tracker.log"
        wait_until(lambda: trackers.read_text().count(" is up") == 2, "another tracker", 40.0)
        wait_until(lambda: log.read_text().count(" is up") == 2, "another follower", 40.0)

        def same_or_asks() -> bool:
            _, _, since = log.read_text().rpartition(" is up")
            return chosen.findall(since)[-1:] == before[-1:] or "choose again" in since

        wait_until(same_or_asks, "the same person, or a question", 40.0)
        assert process.alive
        assert "tracker ended with code -9: started again" in process.stderr()
        assert "follower is frozen for 1 s: started again" in process.stderr()
        code, _ = process.stop(signal.SIGINT, 15.0)
        assert code == 0, process.stderr()
        assert not any(Path(f"/proc/{pid}").exists() for pid in (killed, frozen))


def test_an_end_of_stream_from_a_stranger_ends_neither_the_demo_nor_a_service(
    tmp_path: Path,
) -> None:
    pytest.importorskip("panda3d", reason="the extra sim is not installed")
    truth = tmp_path / "truth.jsonl"
    with running(*BOXES, "--out", str(tmp_path)) as process:
        _log_says(tmp_path, "simulator", "episode")
        flags = Path(f"/proc/{_pid_of(tmp_path, 'drive')}/cmdline").read_bytes().split(b"\0")
        endpoint = flags[flags.index(b"--connect") + 1].decode()
        end = EndOfStream(stream="front", epoch=1, frames=1, reason="a stranger says so")
        with client(endpoint) as stranger:
            for key in ("follow/command", "cam/front/tracks"):
                stranger.put(key, encode(end), encoding=end.encoding())
            size = truth.stat().st_size
            wait_until(lambda: truth.stat().st_size > size + 50_000, "two more seconds", 30.0)
        assert process.alive, process.stderr()
        code, _ = process.stop(signal.SIGINT, 15.0)
        assert code == 0, process.stderr()


def test_without_a_folder_nothing_stays(tmp_path: Path) -> None:
    pytest.importorskip("panda3d", reason="the extra sim is not installed")
    (tmp_path / "heel-demo-left-by-a-killed-one").mkdir()
    code, out, err = finished(
        *FLAGS, "--perception", "simulated-boxes", "--seconds", "2", deadline_s=60.0,
        TMPDIR=str(tmp_path),
    )  # fmt: skip
    assert code == 0, err
    assert "nothing is kept" in out
    assert not list(tmp_path.glob("heel-demo-*"))
