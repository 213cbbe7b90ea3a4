"""`docker-compose.secure.yml`: every container of the robot gets its own key, and no other."""

from __future__ import annotations

from typing import Any

import yaml

from heel.services.security.roles import ROLES
from tests.support.processes import REPOSITORY


def services(name: str) -> dict[str, Any]:
    text = (REPOSITORY / name).read_text(encoding="utf-8")
    found: dict[str, Any] = yaml.safe_load(text)["services"]
    return found


def keys_of(service: dict[str, Any]) -> list[str]:
    mounts = [one.rpartition("/security}")[2] for one in service["volumes"]]
    return [one.split(":")[0].removeprefix("/") for one in mounts]


def test_every_container_has_the_file_of_its_role_and_no_other_secret() -> None:
    plain, secure = services("docker-compose.yml"), services("docker-compose.secure.yml")
    assert secure.keys() == plain.keys()
    for name, service in secure.items():
        command = plain[name]["command"][0]
        assert command in {*ROLES, "router"}
        page = ["page-users", "page.pem"] if command == "web" else []
        assert keys_of(service) == [f"{command}.json5", *page], name
        assert all(one.endswith(":ro") for one in service["volumes"])


def test_nothing_says_insecure_and_everything_goes_over_tls() -> None:
    plain, secure = services("docker-compose.yml"), services("docker-compose.secure.yml")
    for name, service in secure.items():
        command = service.get("command", plain[name]["command"])
        assert "--insecure" not in command, name
        if name != "router":
            assert service["environment"]["HEEL_ZENOH__CONNECT"] == "tls/router:7447"
            assert service["environment"]["HEEL_ZENOH__CONFIG_FILE"] == "/run/heel/member.json5"
    assert "--users-file" in secure["web"]["command"]
    assert "--certificate" in secure["web"]["command"]
    assert "tls/127.0.0.1:7447" in secure["router"]["healthcheck"]["test"]


def test_tls_and_quic_are_published_alike_and_on_loopback_unless_told() -> None:
    router = services("docker-compose.secure.yml")["router"]
    tls, quic = router["ports"]
    assert tls == "${HEEL_PUBLISH:-127.0.0.1}:${HEEL_BUS_PORT:-7447}:7447"
    assert quic == f"{tls}/udp", "QUIC is UDP"
    listening = router["command"][router["command"].index("--listen") + 1].split(",")
    assert listening == ["tls/0.0.0.0:7447", "quic/0.0.0.0:7447"]


def test_what_keeps_the_emergency_stop_keeps_it_on_the_disk() -> None:
    plain = services("docker-compose.yml")
    for name, service in plain.items():
        keeps = service["command"][0] in ("drive", "follower")
        assert ("state:/var/lib/heel" in service.get("volumes", ())) is keeps, name
        if name != "router":
            assert service["environment"]["HEEL_STATE_DIR"] == "/var/lib/heel"
