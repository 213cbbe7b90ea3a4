"""`heel follow`, `stop`, `resume` and `status` against services that are running."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from heel.schemas import Health, encode, keys
from heel.services.runtime.registry import Run, runs
from tests.support.network import client, wait_until
from tests.support.processes import running

HEEL = [sys.executable, "-m", "heel"]


def heel(endpoint: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*HEEL, *arguments, "--connect", endpoint], capture_output=True, text=True, timeout=30,
        check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """A looped scene through all services, as it is found on this machine."""
    out = tmp_path_factory.mktemp("control")
    words = ("run", "scene:demo?width=320&height=240", "--out", str(out), "--live", "--loop")
    with running("-m", "heel", *words, "--target", "none") as process:
        tracks = out / "tracks.txt"
        wait_until(lambda: tracks.is_file() and tracks.stat().st_size > 0, "tracks", 60.0)
        [found] = runs()
        yield found
        process.stop(signal.SIGTERM, 20.0)
    assert runs() == [], "a run that has ended is found no more"


@pytest.fixture(scope="module")
def endpoint(run: Run) -> str:
    return run.endpoint


@contextmanager
def hung(run: Run, service: str) -> Iterator[None]:
    """One of the run's services, stopped from outside."""
    [pid] = [
        int(entry.name)
        for entry in Path("/proc").iterdir()
        if entry.name.isdigit() and _is_child(entry, run.pid, f"heel.services.{service}")
    ]
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


def _is_child(entry: Path, parent: int, module: str) -> bool:
    try:
        words = (entry / "cmdline").read_bytes().decode().split("\0")
        ppid = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
    except OSError:
        return False
    return ppid == parent and module in words


def test_a_run_is_reached_without_its_address(run: Run) -> None:
    done = subprocess.run(
        [*HEEL, "status", "--run", str(run.pid)], capture_output=True, text=True, timeout=30,
        check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert run.endpoint in done.stdout
    assert f"heel run, process {run.pid}" in done.stdout


def test_status_tells_who_is_in_sight_also_as_json(endpoint: str) -> None:
    assert "in sight: " in heel(endpoint, "status").stdout
    told = json.loads(heel(endpoint, "status", "--json").stdout)
    assert told["router"] == endpoint
    assert told["run"]["kind"] == "run"
    assert told["problems"] == []
    assert {one["service"] for one in told["services"]} == {
        "capture", "detector", "tracker", "follower",
    }  # fmt: skip
    assert told["follower"]["target"]["mode"] == "none"
    assert all(person["id"] > 0 for person in told["people"])


def test_a_hung_service_is_named_and_the_command_fails_until_it_is_back(
    run: Run, endpoint: str
) -> None:
    with hung(run, "tracker"):
        done = heel(endpoint, "status")
        assert done.returncode == 1
        # Gone it is, too, once the router has given it up.
        assert re.search(r"^tracker: (silent for 1 s or more|gone)$", done.stdout, re.MULTILINE)
        assert "no tracks for" in done.stdout, "the follower misses its input"
    wait_until(lambda: heel(endpoint, "status").returncode == 0, "all well again", 20.0)


def test_what_services_say_of_themselves_is_text_and_nothing_else(endpoint: str) -> None:
    health = Health(
        service="liar", instance="main", producer="liar/main@0123abcd", state="degraded",
        reason="[/foo] [bold red]x\x1b[2J\nfollower: following (all well)", uptime_s=1.0,
        loop_age_s=0.0, software_version="1", period_s=30.0,
    )  # fmt: skip
    with client(endpoint) as session:
        publisher = session.declare_publisher(keys.health("liar", "main"))
        process = subprocess.Popen(
            [*HEEL, "status", "--connect", endpoint], stdin=subprocess.DEVNULL, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        while process.poll() is None:
            publisher.put(encode(health), encoding=Health.encoding())
            session.put("svc/a\x1b[31m\nheel: on fire/y/health", b"junk", encoding="x")
            time.sleep(0.1)
        out, err = process.communicate(timeout=20)
    assert r"liar/main: [/foo] [bold red]x\x1b[2J\nfollower: following (all well)" in out
    assert "\x1b" not in out + err
    assert not any(line.startswith(("follower: following", "heel: on fire"))
                   for line in (out + err).splitlines())  # fmt: skip


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
