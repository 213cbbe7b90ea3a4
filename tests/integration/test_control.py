"""`heel follow`, `stop`, `resume`, `status`, and the tools that look at the bus, against services
that are running."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from heel.schemas import Health, HeelError, SettingsError, Tracks, encode, keys
from heel.services.cli import app
from heel.services.runtime.registry import Run, runs
from heel.services.runtime.router import RouterSettings, open_router
from heel.services.security.folder import SecurityFolder
from tests.support.network import client, free_port, wait_until
from tests.support.processes import running

HEEL = [sys.executable, "-m", "heel"]


def heel(endpoint: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*HEEL, *arguments, "--connect", endpoint], capture_output=True, text=True, timeout=60,
        check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip


def at_once(endpoint: str, *lines: str) -> dict[str, subprocess.CompletedProcess[str]]:
    """Several commands beside one another: most of the time of each is its start and its wait."""
    with ThreadPoolExecutor(len(lines)) as pool:
        asked = {line: pool.submit(heel, endpoint, *line.split()) for line in lines}
    return {line: one.result() for line, one in asked.items()}


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
    # Any other service that a live run finds frozen is started again.
    with hung(run, "capture"):
        done = heel(endpoint, "status")
        assert done.returncode == 1
        # Gone it is, too, once the router has given it up.
        assert re.search(r"^capture: (silent for 1 s or more|gone)$", done.stdout, re.MULTILINE)
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
        out, err = process.communicate(timeout=60)
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


def follow_nearest(endpoint: str) -> str:
    """What it prints; on a busy machine the picture may be too old for a choice now and then."""
    for _ in range(5):
        done = heel(endpoint, "follow", "nearest")
        if done.returncode == 0:
            return done.stdout
        assert "choose again when the picture is live" in done.stderr
    raise AssertionError(done.stderr)


def test_follow_nearest_then_none(endpoint: str) -> None:
    assert "nearest" in follow_nearest(endpoint)
    done = heel(endpoint, "follow", "none")
    assert "cleared" in done.stdout


def test_following_an_unknown_id_is_refused_with_the_reason(endpoint: str) -> None:
    done = heel(endpoint, "follow", "99999")
    assert done.returncode == 1
    assert "nobody has id 99999" in done.stderr


def test_stop_is_confirmed_and_holds_until_resume(endpoint: str) -> None:
    assert "stopped" in heel(endpoint, "stop").stdout
    follow_nearest(endpoint)
    assert "emergency stop" in heel(endpoint, "status").stdout
    assert "resumed" in heel(endpoint, "resume").stdout
    assert "emergency stop" not in heel(endpoint, "status").stdout


def test_without_a_router_it_says_so_in_one_line() -> None:
    for line, done in at_once("tcp/127.0.0.1:1", "status", "stop", "follow none", "top").items():
        assert done.returncode == 1, line
        assert "tcp/127.0.0.1:1" in done.stderr, line
        assert len(done.stderr.splitlines()) == 1, line


def test_without_certificates_every_verb_asks_for_them(tmp_path: Path) -> None:
    pytest.importorskip("cryptography", reason="the extra `secure` is not installed")
    router = SecurityFolder.create(tmp_path / "keys").folder / "router.json5"
    verbs = ("status", "stop", "resume", "follow none", "top", "doctor", "topics")
    endpoints = [f"{protocol}/127.0.0.1:{free_port()}" for protocol in ("tls", "quic")]
    listening = RouterSettings(listen=tuple(endpoints), config_file=router, shared_memory=False)
    with open_router(listening):
        for endpoint in endpoints:
            for line, done in at_once(endpoint, *verbs).items():
                assert done.returncode == 1, line
                told = done.stdout if line == "doctor" else done.stderr
                assert f"{endpoint}: {endpoint.partition('/')[0]}/ needs certificates" in told, line
                assert "`heel security init DIR`" in told, line
                assert "no Zenoh router" not in told, line


def tool(endpoint: str, line: str) -> str:
    """What a tool prints; within this process, as most of its time elsewhere is its start."""
    done = CliRunner().invoke(app, [*line.split(), "--connect", endpoint])
    if done.exception is not None:
        raise done.exception
    return done.stdout


def test_topics_are_listed_with_rate_and_sender(endpoint: str) -> None:
    table = tool(endpoint, "topics --for 1")
    assert re.search(r"^cam/front/tracks +tracks +\d", table, re.MULTILINE)
    assert re.search(r"^cam/front/info +info +kept", table, re.MULTILINE)
    listed = json.loads(tool(endpoint, "topics --for 1 --json"))["topics"]
    topics = {one["key"]: one for one in listed}
    assert topics["cam/front/image"]["bytes_mean"] == 320 * 240 * 3
    assert topics["cam/front/tracks"]["producers"][0].startswith("tracker/main@")
    assert topics["follow/state"]["latched"]


def test_how_often_and_how_much_comes_is_told(endpoint: str) -> None:
    assert re.search(r"^cam/front/tracks  \d.*/s, every ", tool(endpoint, "hz tracks --count 9"))
    [figures] = tool(endpoint, "hz tracks --count 3 --json").splitlines()
    assert json.loads(figures)["count"] == 3
    assert "in all  " in tool(endpoint, "bw --for 1.1")


def test_messages_are_told_decoded(endpoint: str) -> None:
    assert tool(endpoint, "echo tracks --count 2").count("cam/front/tracks tracker/main ") == 2
    image = json.loads(tool(endpoint, "echo image --count 1 --json"))
    assert image["message"]["bytes"] == 320 * 240 * 3
    assert tool(endpoint, "echo state --count 1").startswith("follow/state  seq=")
    assert "/config  " in tool(endpoint, "echo svc/*/*/config --count 1")


def test_the_doctor_finds_a_run_in_order(endpoint: str) -> None:
    # Whether this machine has room, time and memory enough is not this test's.
    done = CliRunner().invoke(app, ["doctor", "--json", "--connect", endpoint])
    found = {one["about"]: one for one in json.loads(done.stdout)["findings"]}
    for about in ("router", "services", "versions", "camera"):
        assert found[about]["level"] == "ok", found[about]
    assert "capture/main sends " in found["camera"]["words"]
    assert "heel calibrate" in found["calibration"]["remedy"]


def test_services_are_told_in_a_table(endpoint: str) -> None:
    assert re.search(
        r"^tracker/main +(ok|degraded) ", tool(endpoint, "top --count 1"), re.MULTILINE
    )
    told = json.loads(tool(endpoint, "top --count 1 --json"))
    assert all(one["cpu_percent"] is not None for one in told["services"])


def test_bytes_that_are_no_message_are_told_of_and_end_nothing(endpoint: str) -> None:
    with client(endpoint) as session:
        publisher = session.declare_publisher("cam/other/tracks")
        process = subprocess.Popen(
            [*HEEL, "echo", "cam/other/*", "--count", "3", "--connect", endpoint], text=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        while process.poll() is None:
            publisher.put(b"\xc1\x1b[2J", encoding=Tracks.encoding())
            publisher.put(b"\x1b[2J\nheel: on fire", encoding="text/x\x1b[2J")
            time.sleep(0.05)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert "cam/other/tracks  undecodable: tracks: not msgpack" in out
    assert len(out.splitlines()) == 3
    assert all(line.isprintable() for line in out.splitlines())


def test_a_topic_that_nobody_sends_and_what_is_no_topic_are_errors(endpoint: str) -> None:
    with pytest.raises(HeelError, match="nothing came on nobody/sends: `heel topics`"):
        tool(endpoint, "hz nobody/sends --for 0.3")
    with pytest.raises(SettingsError, match="is no topic: name one of image, jpeg, depth, taken"):
        tool(endpoint, "echo a//b")


def test_what_goes_on_ends_at_ctrl_c(endpoint: str) -> None:
    lines = ("top", "status --watch", "echo command")
    with ExitStack() as stack:
        started = [
            stack.enter_context(running("-m", "heel", *line.split(), "--connect", endpoint))
            for line in lines
        ]
        for process in started:
            wait_until(lambda process=process: process.stdout() != "", "a line", 60.0)
            code, _ = process.stop(signal.SIGINT, 20.0)
            assert (code, process.stderr()) == (0, "")


def test_who_watches_a_run_that_dies_is_told_and_ends(tmp_path: Path) -> None:
    """A note, a process and a router stand in for the run, which a signal ends all at once."""
    program = (
        "import logging, time\n"
        "from heel.services.runtime.registry import registered\n"
        "from heel.services.runtime.router import open_private_router\n"
        "with open_private_router() as (_, endpoint):\n"
        "    with registered('demo', 'x', endpoint, ('tracker',), logging.getLogger()):\n"
        "        time.sleep(60)\n"
    )
    with running("-c", program, HEEL_RUNTIME_DIR=str(tmp_path)) as fake:
        wait_until(lambda: any((tmp_path / "runs").glob("*")), "the note of the run", 20.0)
        with running("-m", "heel", "top", HEEL_RUNTIME_DIR=str(tmp_path)) as top:
            wait_until(lambda: "tracker: gone" in top.stdout(), "a table", 60.0)
            fake.process.kill()
            assert top.wait(20.0) == 1
            assert f"heel demo (process {fake.process.pid}) has ended" in top.stderr()
