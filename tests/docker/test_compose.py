"""`docker compose up`: healthy, tracking, by shared memory, and back after every failure."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from benchmarks.compose_start import first_person_s
from tests.docker.engine import REPOSITORY, SERVICES, Project
from tests.support.network import wait_until

pytestmark = [pytest.mark.docker, pytest.mark.timeout(360)]

HEALTHY_S = 45.0
BACK_S = 30.0
DOWN_S = 5.0


def test_the_first_person_is_soon_on_the_page(project: Project) -> None:
    first_person_s(f"http://127.0.0.1:{project.port}", HEALTHY_S)
    print(f"first person {time.monotonic() - project.asked_s:.1f} s after docker compose up")


def test_every_container_becomes_healthy(project: Project) -> None:
    for service in SERVICES:
        wait_until(
            lambda service=service: project.health(service) == "healthy",
            f"{service} is healthy", HEALTHY_S,
        )  # fmt: skip


def test_tracks_flow_and_every_large_message_goes_by_shared_memory(project: Project) -> None:
    reading = project.read(seconds=4.0, tracks=60)
    assert reading.tracks >= 60
    assert reading.people >= 1
    # Zenoh falls back to TCP without a word, so the receivers are asked.
    assert reading.by_shared_memory() == {"detector": True, "tracker": True, "web": True}
    assert {said["state"] for said in reading.health.values()} == {"ok"}


@pytest.mark.parametrize("service", SERVICES)
def test_service_runs_as_nobody_in_particular(project: Project, service: str) -> None:
    status = project.compose("exec", "-T", service, "cat", "/proc/1/status")
    fields = dict(line.split(":\t", 1) for line in status.splitlines() if ":\t" in line)
    assert fields["Uid"].split() == ["10001"] * 4
    assert int(fields["CapEff"], 16) == 1 << 14, "IPC_LOCK and nothing else"
    assert fields["NoNewPrivs"] == "1"
    writable = "touch /etc/x /opt/x /usr/x 2>/dev/null && echo writable || echo read-only"
    said = project.compose("exec", "-T", service, "sh", "-c", writable)
    assert said.strip() == "read-only"
    limits = project.inspect(service)["HostConfig"]
    assert 0 < limits["Memory"] <= 1536 << 20
    assert 0 < limits["PidsLimit"] <= 128
    assert limits["RestartPolicy"]["Name"] == "unless-stopped"


def test_only_the_page_is_published_and_only_on_loopback(project: Project) -> None:
    published = {
        service: project.inspect(service)["NetworkSettings"]["Ports"] for service in SERVICES
    }
    page = {f"{project.port}/tcp": [{"HostIp": "127.0.0.1", "HostPort": str(project.port)}]}
    assert published == {service: page if service == "web" else {} for service in SERVICES}
    assert b"<title>Heel" in project.page("/")
    state = json.loads(project.page("/api/state"))
    assert state["picture"]["age_s"] < 1.0


@pytest.mark.skipif(os.geteuid() != 0, reason="ending a container's process takes root")
@pytest.mark.parametrize("service", ["detector", "tracker"])
def test_killed_service_is_restarted_and_tracks_flow_again(project: Project, service: str) -> None:
    before = project.inspect(service)
    pid = before["State"]["Pid"]
    if b"heel" not in _command_line(pid):
        pytest.skip("the engine's processes are not this machine's")
    # From inside, and for `docker kill`, it would be an order to stop that no policy undoes.
    os.kill(pid, signal.SIGKILL)
    wait_until(
        lambda: project.inspect(service)["RestartCount"] > before["RestartCount"],
        f"{service} is restarted", BACK_S,
    )  # fmt: skip
    reading = project.read(tracks=40, deadline_s=BACK_S)
    assert reading.tracks >= 40
    print(f"{service} killed: 40 tracks messages {reading.waited_s:.1f} s after the restart")


def _command_line(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def test_restarted_router_is_found_again_with_shared_memory(project: Project) -> None:
    project.compose("restart", "router")
    reading = project.read(seconds=4.0, tracks=60, deadline_s=BACK_S)
    assert reading.tracks >= 60
    assert reading.by_shared_memory() == {"detector": True, "tracker": True, "web": True}
    print(f"router restarted: 60 tracks messages within {reading.waited_s:.1f} s")


def test_down_is_clean_and_quick(project: Project) -> None:
    containers = {service: project.container(service) for service in SERVICES}
    with ExitStack() as stack:
        # Asked before, because nothing of a container is left afterwards.
        waiting = {
            service: stack.enter_context(_exit_code_of(container))
            for service, container in containers.items()
        }
        took_s = project.down()
        codes = {
            service: int(process.communicate(timeout=10)[0]) for service, process in waiting.items()
        }
    print(f"docker compose down: {took_s:.1f} s")
    assert codes == dict.fromkeys(SERVICES, 0), "every service ended by itself"
    assert project.left_behind() == []
    assert took_s < DOWN_S


def _exit_code_of(container: str) -> subprocess.Popen[str]:
    return subprocess.Popen(["docker", "wait", container], stdout=subprocess.PIPE, text=True)


@pytest.mark.skipif(shutil.which("docker-compose") is None, reason="no docker-compose 1.x here")
def test_docker_compose_one_reads_the_file_too(project: Project) -> None:
    assert "setpriv" in project.run("docker-compose", "config")


def test_official_router_is_one_changed_line(project: Project, tmp_path: Path) -> None:
    ours = (REPOSITORY / "docker-compose.yml").read_text(encoding="utf-8")
    assert ours.count("<<: *heel-router") == 1
    changed = tmp_path / "docker-compose.yml"
    changed.write_text(ours.replace("<<: *heel-router", "<<: *zenohd"), encoding="utf-8")
    said = project.compose("-f", str(changed), "config", "--images")
    assert "eclipse/zenoh:" in said
