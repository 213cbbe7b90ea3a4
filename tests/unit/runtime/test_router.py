"""The router: whom it lets in, what it says of those it does not, and how much it takes of them."""

from __future__ import annotations

import json
import logging
import os
from pathlib import Path

import pytest
import zenoh

from heel.schemas.errors import HeelError, SettingsError
from heel.services.runtime.router import (
    RouterSettings,
    open_private_router,
    open_router,
    router_config,
)
from heel.services.runtime.router_log import RouterLog
from heel.services.runtime.session import MAX_MESSAGE_BYTES, zenoh_config
from heel.services.runtime.settings import ZenohSettings
from tests.support.network import wait_until

WIDE = ("tcp/0.0.0.0:7447",)
LOG = logging.getLogger("heel.router")


def users(folder: Path, text: str, mode: int = 0o600) -> Path:
    file = folder / "users.txt"
    file.write_text(text)
    file.chmod(mode)
    return file


@pytest.mark.parametrize(
    ("text", "mode", "said"),
    [
        ("", 0o600, "names nobody"),
        ("\n \n", 0o600, "names nobody"),
        ("robot\n", 0o600, "line 1"),
        ("robot:secret\n:secret\n", 0o600, "line 2"),
        ("robot:\n", 0o600, "line 1"),
        ("# who may\nrobot:secret\n", 0o600, "line 1"),
        ("robot:secret\n", 0o666, "chmod 600"),
        ("robot:secret\n", 0o620, "chmod 600"),
    ],
)
def test_a_users_file_that_lets_in_whom_nobody_meant_is_refused(
    text: str, mode: int, said: str, tmp_path: Path
) -> None:
    for listen in (WIDE, ("tcp/127.0.0.1:7447",)):
        with pytest.raises(SettingsError, match=said) as error:
            router_config(RouterSettings(listen=listen, users_file=users(tmp_path, text, mode)))
        assert "secret" not in str(error.value)


def test_udp_is_as_open_to_the_network_as_tcp(tmp_path: Path) -> None:
    for listen in ("udp/0.0.0.0:7447", "quic/192.168.1.7:7447"):
        with pytest.raises(SettingsError, match="without authentication"):
            router_config(RouterSettings(listen=("tcp/127.0.0.1:7447", listen)))
    known = users(tmp_path, "robot:secret\n")
    config = router_config(RouterSettings(listen=("udp/0.0.0.0:7447",), users_file=known))
    assert json.loads(config.get_json("listen/endpoints")) == [
        "udp/0.0.0.0:7447?mixed_rel=1;rel=1"
    ]  # fmt: skip


def test_a_users_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"nobody\.txt"):
        router_config(RouterSettings(users_file=tmp_path / "nobody.txt"))


@pytest.mark.parametrize(
    "text",
    [
        "{}",
        '{transport: {link: {tls: {listen_certificate: "c.pem", listen_private_key: "k.pem"}}}}',
        '{access_control: {enabled: true, default_permission: "allow", rules: [], '
        "subjects: [], policies: []}}",
    ],
    ids=["nothing", "certificate of the router alone", "rules that allow"],
)
def test_a_config_file_that_tells_nobody_apart_is_no_authentication(
    text: str, tmp_path: Path
) -> None:
    file = tmp_path / "zenoh.json5"
    file.write_text(text)
    with pytest.raises(SettingsError, match="enable_mtls"):
        router_config(RouterSettings(listen=WIDE, config_file=file))
    router_config(RouterSettings(listen=WIDE, config_file=file, insecure=True))


def test_a_config_file_with_users_is_authentication_unless_their_file_is_empty(
    tmp_path: Path,
) -> None:
    file, known = tmp_path / "zenoh.json5", users(tmp_path, "robot:secret\n")
    file.write_text(f'{{transport: {{auth: {{usrpwd: {{dictionary_file: "{known}"}}}}}}}}')
    router_config(RouterSettings(listen=WIDE, config_file=file))
    known.write_text("")
    with pytest.raises(SettingsError, match="names nobody"):
        router_config(RouterSettings(listen=WIDE, config_file=file))


def test_a_config_file_with_certificates_of_clients_is_authentication(tmp_path: Path) -> None:
    file = tmp_path / "zenoh.json5"
    file.write_text("{transport: {link: {tls: {enable_mtls: true}}}}")
    router_config(RouterSettings(listen=("tls/0.0.0.0:7447",), config_file=file))


def test_what_is_no_endpoint_is_said_to_be_none() -> None:
    with pytest.raises(SettingsError, match="'7447' is not an endpoint"):
        router_config(RouterSettings(listen=("7447",)))


@pytest.mark.parametrize("protocol", ["tls", "quic"])
def test_certificates_that_are_missing_are_not_told_as_a_port_in_use(protocol: str) -> None:
    settings = RouterSettings(listen=(f"{protocol}/127.0.0.1:0",), shared_memory=False)
    with (
        pytest.raises(HeelError, match="needs certificates; `heel security init DIR`"),
        open_router(settings),
    ):
        pass


def test_refused_clients_are_named_with_where_they_came_from(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO)
    ends: list[bool] = []
    log = RouterLog(LOG, lambda: ends.append(True))
    accept = "2026-01-01T00:00:00.0Z DEBUG acc-0 zenoh_transport::unicast::establishment::accept:"
    log.line("2026-01-01T00:00:00.0Z DEBUG acc-0 zenoh_link_tcp::unicast: Accepted TCP connection"
             " on 10.0.0.1:7447: 10.0.0.9:4711", 0.0)  # fmt: skip
    log.line(f"{accept} UsrPwd extension - Recv OpenSyn. Invalid password. at /x/usrpwd.rs:4.", 0.1)
    log.line(f"{accept} UsrPwd extension - Recv OpenSyn. Invalid user. at /x/usrpwd.rs:4.", 0.2)
    log.line(f"{accept} UsrPwd extension - Recv InitSyn. Expected extension. at /x.rs:4.", 1.3)
    said = [record.getMessage() for record in caplog.records]
    assert said == [
        "refused a client at 10.0.0.9:4711: wrong password",
        "refused a client at 10.0.0.9:4711: no user named (1 more like it)",
    ]
    assert not ends


def test_a_thread_of_zenoh_that_died_ends_the_router(caplog: pytest.LogCaptureFixture) -> None:
    ends: list[bool] = []
    log = RouterLog(LOG, lambda: ends.append(True))
    log.line("thread 'rx-1' panicked at zenoh-shm/src/metadata/storage.rs:31:82:", 0.0)
    assert ends == [True]
    assert "has died" in caplog.text


def test_an_escape_sequence_in_a_line_reaches_no_terminal(caplog: pytest.LogCaptureFixture) -> None:
    log = RouterLog(LOG, lambda: None)
    log.line("what is \x1b]0;pwned\x07 this", 0.0)
    assert "\x1b" not in caplog.text
    assert "\x07" not in caplog.text


def test_a_message_beyond_the_bound_reaches_nobody_and_the_next_one_does() -> None:
    got: list[int] = []
    with open_private_router(shared_memory=False) as (_, endpoint):
        config = zenoh_config(ZenohSettings(connect=(endpoint,), shared_memory=False))
        with zenoh.open(config) as sender, zenoh.open(config) as receiver:
            receiver.declare_subscriber("follow/command", lambda one: got.append(len(one.payload)))
            out = sender.declare_publisher(
                "follow/command", congestion_control=zenoh.CongestionControl.BLOCK
            )
            wait_until(lambda: bool(out.matching_status.matching), "a listener")
            out.put(bytes(MAX_MESSAGE_BYTES + (1 << 20)))
            out.put(b"next")
            wait_until(lambda: bool(got), "the next message")
    assert got == [4]


def test_a_query_beyond_the_bound_is_asked_of_nobody() -> None:
    asked: list[int] = []

    def answer(query: zenoh.Query) -> None:
        with query:
            asked.append(len(query.payload or b""))
            query.reply("follow/target", b"ok")

    with open_private_router(shared_memory=False) as (_, endpoint):
        config = zenoh_config(ZenohSettings(connect=(endpoint,), shared_memory=False))
        with zenoh.open(config) as sender, zenoh.open(config) as receiver:
            receiver.declare_queryable("follow/target", answer)
            wait_until(lambda: bool(list(sender.get("follow/target", timeout=1.0))), "an answer")
            asked.clear()
            assert not list(sender.get("follow/target", payload=bytes(1 << 20), timeout=1.0))
            assert list(sender.get("follow/target", payload=b"7", timeout=1.0))
    assert asked == [1]


def test_the_password_of_debug_logs_stays_out_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    from heel.services.runtime import session

    asked: list[str] = []
    monkeypatch.setattr(session.zenoh, "init_log_from_env_or", asked.append)
    monkeypatch.setenv("RUST_LOG", "debug")
    session.start_zenoh_log()
    assert os.environ["RUST_LOG"] == "debug,zenoh::api::session=info"
    assert asked
