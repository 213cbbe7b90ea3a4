"""`docker-compose.secure.yml`: every container with its own certificate, and nobody else let in."""

from __future__ import annotations

import json
import os
import ssl
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from heel.services.security.folder import SecurityFolder
from tests.docker.engine import Project, free_port
from tests.support.network import wait_until

pytest.importorskip("cryptography", reason="the extra `secure` is not installed")
pytestmark = [
    pytest.mark.docker, pytest.mark.timeout(360),
    pytest.mark.skipif(os.geteuid() != 0, reason="giving files to the containers' user takes root"),
]  # fmt: skip

PASSWORD = "correct horse"
START_S = 60.0
_USER = 10001


@dataclass
class Robot:
    """A project with certificates, and what is needed to reach it."""

    project: Project
    keys: Path
    bus: str

    def ask(self, path: str, cookie: str = "", body: dict[str, str] | None = None) -> Any:
        """The answer of the page, over TLS that its own authority is trusted for."""
        trusted = ssl.create_default_context(cafile=self.keys / "authority.crt")
        asked = urllib.request.Request(
            f"https://127.0.0.1:{self.project.port}{path}",
            None if body is None else json.dumps(body).encode(),
            {"Content-Type": "application/json", "Cookie": cookie},
        )
        return urllib.request.urlopen(asked, timeout=5, context=trusted)


@pytest.fixture(scope="module")
def robot(image: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    folder = tmp_path_factory.mktemp("secure")
    made = SecurityFolder.create(folder / "keys")
    made.set_login("anna", "operate", PASSWORD)
    for file in (
        *made.folder.glob("*.json5"),
        made.folder / "page.pem",
        made.folder / "page-users",
    ):
        os.chown(file, _USER, _USER)
    port = free_port()
    project = Project(
        folder, COMPOSE_FILE="docker-compose.yml:docker-compose.secure.yml",
        HEEL_SECURITY=str(made.folder), HEEL_BUS_PORT=str(port),
    )  # fmt: skip
    try:
        project.up()
        yield Robot(project, made.folder, f"127.0.0.1:{port}")
    finally:
        project.down()


def test_whoever_is_logged_in_sees_people_and_nothing_is_missing(robot: Robot) -> None:
    def served() -> bool:
        try:
            return b'id="password"' in robot.ask("/").read()
        except (urllib.error.URLError, ConnectionError):
            return False

    wait_until(served, "the login", START_S)
    with pytest.raises(urllib.error.HTTPError, match="401"):
        robot.ask("/api/state")
    answer = robot.ask("/api/login", body={"user": "anna", "password": PASSWORD})
    cookie = answer.headers["Set-Cookie"].partition(";")[0]

    def whole() -> bool:
        state = json.loads(robot.ask("/api/state", cookie).read())
        age_s = (state["picture"] or {}).get("age_s")
        return age_s is not None and age_s < 1.0 and not state["problems"]

    wait_until(whole, "a fresh picture, and no part missing", START_S)


def test_an_operator_of_this_robot_gets_in_from_the_host_and_nobody_else(
    robot: Robot, tmp_path: Path
) -> None:
    operator = ("--config-file", str(robot.keys / "operator.json5"))
    code, said = robot.project.status("--connect", f"tls/{robot.bus}", *operator)
    assert code == 0, said
    assert {line.split("/")[0] for line in said.splitlines() if "/main" in line} >= {
        "capture", "detector", "tracker", "follower", "drive", "web",
    }  # fmt: skip
    received = [line.split()[-1] for line in said.splitlines() if line.startswith("detector/main")]
    assert received == ["yes"], "frames go through shared memory, TLS or not"
    code, said = robot.project.status("--connect", f"quic/{robot.bus}", *operator)
    assert code == 0, said
    for stranger in (
        ("--connect", f"tcp/{robot.bus}"),
        ("--connect", f"quic/{robot.bus}"),
        ("--connect", f"tls/{robot.bus}"),
        ("--connect", f"tls/{robot.bus}", "--config-file",
         str(SecurityFolder.create(tmp_path / "other").folder / "operator.json5")),
    ):  # fmt: skip
        code, said = robot.project.status(*stranger)
        assert code == 1, said
        assert "tracker/" not in said


def test_the_router_answers_its_health_check(robot: Robot) -> None:
    check = robot.project.inspect("router")["Config"]["Healthcheck"]["Test"]
    robot.project.compose("exec", "-T", "router", *check[1:])


def test_all_ports_are_on_loopback_unless_somebody_says_otherwise(robot: Robot) -> None:
    for service in ("router", "web"):
        published = robot.project.inspect(service)["NetworkSettings"]["Ports"]
        hosts = {one["HostIp"] for ports in published.values() for one in ports or ()}
        assert hosts == {"127.0.0.1"}, service
        assert ("7447/udp" in published) is (service == "router")
