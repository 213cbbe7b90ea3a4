"""Opening a session: a deadline, one line for people, credentials."""

from __future__ import annotations

import json
import logging
import threading
import time
from pathlib import Path

import pytest
import zenoh

from heel.schemas.errors import HeelError, SettingsError
from heel.services.runtime.router import RouterSettings, is_loopback, open_router, router_config
from heel.services.runtime.session import open_session, without_certificates, zenoh_config
from heel.services.runtime.settings import ZenohSettings
from heel.services.security.folder import SecurityFolder
from tests.support.network import DEADLINE_S, collected, wait_for_listener

_LOG = logging.getLogger("heel.test")


def free_endpoint() -> str:
    """An address at which nobody listens."""
    import socket

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def never(_seconds: float) -> bool:
    """Do not wait between attempts."""
    return False


def settings(**given: object) -> ZenohSettings:
    return ZenohSettings.model_validate(given)


def test_no_router_ends_at_the_deadline_and_names_endpoint_and_remedy(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO)
    endpoint = free_endpoint()
    started_s = time.monotonic()
    with pytest.raises(HeelError) as error:
        open_session(
            settings(connect=[endpoint], connect_timeout_s=0.5), _LOG, threading.Event().wait
        )
    assert 0.5 <= time.monotonic() - started_s < 3.0
    said = str(error.value)
    assert endpoint in said
    assert "within 0.5 s" in said
    assert "heel router" in said
    assert "\n" not in said
    assert caplog.messages == [f"waiting for a router at {endpoint}"]


def test_waiting_ends_when_the_process_is_told_to_stop() -> None:
    stop = threading.Event()
    stop.set()
    opened = open_session(settings(connect=[free_endpoint()]), _LOG, stop.wait)
    assert opened is None


def test_a_router_that_comes_late_is_found() -> None:
    endpoint = free_endpoint()
    routers = []

    def start_router(_seconds: float) -> bool:
        if not routers:
            routers.append(zenoh.open(router_config(RouterSettings(listen=(endpoint,)))))
        return False

    session = open_session(settings(connect=[endpoint]), _LOG, start_router)
    try:
        assert session is not None
    finally:
        if session is not None:
            session.close()
        routers[0].close()


@pytest.mark.parametrize(
    "endpoint",
    [
        "nonsense",
        "tcp",
        "smoke/127.0.0.1:7447",
        "tcp/",
        "",
        "tcp/a b:1",
        "tcp/[::1]",
        "tls/host",
        "tcp/127.0.0.1:99999",
        "udp/127.0.0.1:1x",
    ],
    ids=str,
)
def test_bad_endpoints_are_errors_that_name_them(endpoint: str) -> None:
    with pytest.raises(SettingsError, match="is not an endpoint: write one like tcp/") as error:
        open_session(settings(connect=[endpoint]), _LOG, never)
    assert repr(endpoint) in str(error.value)


@pytest.mark.parametrize(
    ("content", "words"), [(None, "zenoh"), ("{ mode: 7 }", "zenoh"), ("{ mood: 1 }", "zenoh")]
)
def test_bad_zenoh_files_are_settings_errors(
    content: str | None, words: str, tmp_path: Path
) -> None:
    file = tmp_path / "zenoh.json5"
    if content is not None:
        file.write_text(content)
    with pytest.raises(SettingsError, match=words) as error:
        zenoh_config(settings(config_file=file))
    assert "\n" not in str(error.value)


def test_settings_win_over_the_zenoh_file(tmp_path: Path) -> None:
    file = tmp_path / "zenoh.json5"
    file.write_text(
        '{ mode: "peer", transport: { link: { tx: { queue: { size: { data: 3 } } } } } }'
    )
    config = zenoh_config(settings(config_file=file))
    assert json.loads(config.get_json("mode")) == "client"
    assert json.loads(config.get_json("transport/link/tx/queue/size/data")) == 3


def test_addresses_of_the_zenoh_file_win_over_those_that_nobody_gave(tmp_path: Path) -> None:
    file = tmp_path / "zenoh.json5"
    file.write_text('{ connect: { endpoints: ["tcp/robot:1"] }, namespace: "r1" }')
    assert settings(config_file=file).connect == ("tcp/robot:1",)
    assert settings(config_file=str(file)).namespace == "r1"
    given = settings(config_file=file, connect="tcp/other:1", namespace="r2")
    assert (given.connect, given.namespace) == (("tcp/other:1",), "r2")
    file.write_text("{}")
    assert settings(config_file=file).connect == ("tcp/127.0.0.1:7447",)


def test_the_measured_traps_are_set() -> None:
    config = zenoh_config(settings(namespace="robots/r1"))
    read = {
        path: json.loads(config.get_json(path))
        for path in (
            "scouting/multicast/enabled", "connect/endpoints", "namespace",
            "transport/shared_memory/enabled", "connect/retry",
        )
    }  # fmt: skip
    assert read["scouting/multicast/enabled"] is False
    assert read["connect/endpoints"] == ["tcp/127.0.0.1:7447#so_sndbuf=32768"]
    assert read["namespace"] == "robots/r1"
    assert read["transport/shared_memory/enabled"] is True
    assert read["connect/retry"]["period_max_ms"] == 300


@pytest.mark.parametrize(
    ("given", "sent"),
    [
        ("tcp/h:1", "tcp/h:1#so_sndbuf=32768"),
        ("tcp/h:1#x=1", "tcp/h:1#x=1"),
        ("tls/h:1", "tls/h:1#so_sndbuf=32768"),
        ("quic/h:1", "quic/h:1?mixed_rel=1"),
        ("quic/h:1#x=1", "quic/h:1?mixed_rel=1#x=1"),
        ("udp/h:1", "udp/h:1?mixed_rel=1;rel=1"),
        ("udp/h:1?rel=0", "udp/h:1?rel=0"),
    ],
)
def test_endpoints_get_a_bounded_send_buffer_or_datagrams(given: str, sent: str) -> None:
    config = zenoh_config(settings(connect=[given]))
    assert json.loads(config.get_json("connect/endpoints")) == [sent]


def test_peers_listen_so_that_they_can_be_reached() -> None:
    config = zenoh_config(settings(mode="peer", connect=[]))
    assert json.loads(config.get_json("listen/endpoints")) == ["tcp/127.0.0.1:0"]


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> object:
    """A router that knows one user; yields its endpoint."""
    users = tmp_path_factory.mktemp("router") / "users.txt"
    users.write_text("robot:hunter2\n")
    endpoint = free_endpoint()
    with open_router(RouterSettings(listen=(endpoint,), users_file=users)):
        yield endpoint


def test_users_with_the_right_password_are_let_in(guarded: str) -> None:
    session = open_session(
        settings(connect=[guarded], user="robot", password="hunter2"), _LOG, never
    )
    assert session is not None
    with session, collected(session, "guarded/x") as samples:
        out = session.declare_publisher("guarded/x")
        wait_for_listener(out)
        out.put(b"1")
        assert samples.get(timeout=DEADLINE_S).payload.to_bytes() == b"1"


@pytest.mark.parametrize(
    "given", [{}, {"user": "robot", "password": "wrong"}, {"user": "eve", "password": "hunter2"}],
    ids=["nobody", "wrong password", "unknown user"],
)  # fmt: skip
def test_others_are_kept_out(given: dict[str, str], guarded: str) -> None:
    with pytest.raises(HeelError, match="no Zenoh router at") as error:
        open_session(
            settings(connect=[guarded], connect_timeout_s=0.3, **given), _LOG,
            threading.Event().wait,
        )  # fmt: skip
    assert "hunter2" not in str(error.value)


@pytest.mark.parametrize("protocol", ["tls", "quic"])
def test_certificates_that_are_missing_are_not_told_as_a_router_that_is(protocol: str) -> None:
    asked = settings(connect=[f"{protocol}/127.0.0.1:1"], connect_timeout_s=0.0)
    with pytest.raises(HeelError) as error:
        open_session(asked, _LOG, never)
    told = str(error.value)
    assert f"{protocol}/ needs certificates, and none are given: give a member's" in told
    assert "--config-file" in told
    assert "`heel security init DIR`" in told
    assert "heel doctor" not in told


def test_certificates_are_found_in_a_members_file_and_in_an_endpoint(tmp_path: Path) -> None:
    pytest.importorskip("cryptography", reason="the extra `secure` is not installed")
    member = SecurityFolder.create(tmp_path / "keys").folder / "operator.json5"
    config = zenoh_config(settings(config_file=member))
    own = "tls/robot.local:7447#root_ca_certificate_file=ca.pem"
    assert without_certificates(["quic/127.0.0.1:1"], config) == ""
    assert without_certificates([own, "udp/127.0.0.1:1"], zenoh.Config()) == ""
    assert without_certificates([own, "quic/127.0.0.1:1"], zenoh.Config()).startswith("quic/ needs")


@pytest.mark.parametrize(
    ("endpoint", "loopback"),
    [("tcp/127.0.0.1:7447", True), ("tcp/localhost:1", True), ("tcp/[::1]:1", True),
     ("tcp/127.8.8.8:1#so_sndbuf=1", True), ("unixsock-stream//tmp/x", True),
     ("tcp/0.0.0.0:7447", False), ("tcp/[::]:7447", False), ("tcp/192.168.1.2:1", False),
     ("tcp/localhost.evil.example:1", False), ("tcp/127.0.0.1.evil.example:1", False),
     ("tcp/:7447", False), ("nonsense", False)],
)  # fmt: skip
def test_routers_tell_loopback_from_the_network(endpoint: str, loopback: bool) -> None:
    assert is_loopback(endpoint) == loopback


def test_routers_do_not_open_themselves_to_the_network_unasked() -> None:
    with pytest.raises(SettingsError, match="--insecure"):
        router_config(RouterSettings(listen=("tcp/0.0.0.0:7447",)))
    router_config(RouterSettings(listen=("tcp/0.0.0.0:7447",), insecure=True))


def test_a_port_in_use_is_one_line_that_names_it(endpoint: str) -> None:
    with (
        pytest.raises(HeelError, match="in use") as error,
        open_router(RouterSettings(listen=(endpoint,))),
    ):
        pass
    assert endpoint in str(error.value)
    assert "\n" not in str(error.value)
