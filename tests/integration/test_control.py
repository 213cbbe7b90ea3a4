"""`heel follow`, `stop`, `resume` and `status` against services that are running."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.network import wait_until

HEEL = [sys.executable, "-m", "services"]


def heel(endpoint: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*HEEL, *arguments, "--connect", endpoint], capture_output=True, text=True, timeout=30,
        check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A looped scene through all services, and the router's endpoint."""
    out = tmp_path_factory.mktemp("control")
    run = subprocess.Popen(
        [*HEEL, "run", "scene:demo?width=320&height=240", "--out", str(out), "--live", "--loop",
         "--target", "none"],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        tracks = out / "tracks.txt"
        wait_until(lambda: tracks.is_file() and tracks.stat().st_size > 0, "tracks", 60.0)
        yield _endpoint_of_children(out)
    finally:
        run.terminate()
        run.wait(timeout=20)


def _endpoint_of_children(out: Path) -> str:
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit() or int(entry.name) == os.getpid():
            continue
        try:
            words = (entry / "cmdline").read_bytes().decode().split("\0")
            files = {os.readlink(link) for link in (entry / "fd").iterdir()}
        except OSError:
            continue
        if str(out / "logs" / "tracker.log") in files and "--connect" in words:
            return words[words.index("--connect") + 1]
    raise AssertionError("no tracker of this run")


def test_status_names_every_service_and_the_follower(endpoint: str) -> None:
    done = heel(endpoint, "status")
    assert done.returncode == 0, done.stderr
    for service in ("capture/main", "detector/main", "tracker/main", "follower/main"):
        assert service in done.stdout
    assert "follower: " in done.stdout


def test_follow_nearest_then_none(endpoint: str) -> None:
    done = heel(endpoint, "follow", "nearest")
    assert done.returncode == 0, done.stderr
    assert "nearest" in done.stdout
    done = heel(endpoint, "follow", "none")
    assert "cleared" in done.stdout


def test_following_an_unknown_id_is_refused_with_the_reason(endpoint: str) -> None:
    done = heel(endpoint, "follow", "99999")
    assert done.returncode == 1
    assert "nobody has id 99999" in done.stderr


def test_stop_is_confirmed_and_holds_until_resume(endpoint: str) -> None:
    assert "stopped" in heel(endpoint, "stop").stdout
    assert heel(endpoint, "follow", "nearest").returncode == 0
    assert "emergency stop" in heel(endpoint, "status").stdout
    assert "resumed" in heel(endpoint, "resume").stdout
    assert "emergency stop" not in heel(endpoint, "status").stdout


@pytest.mark.parametrize("verb", [["status"], ["stop"], ["follow", "none"]])
def test_without_a_router_it_says_so_in_one_line(verb: list[str]) -> None:
    done = heel("tcp/127.0.0.1:1", *verb)
    assert done.returncode == 1
    assert "tcp/127.0.0.1:1" in done.stderr
    assert "Traceback" not in done.stderr
