"""Commands and an address at which nobody answers: over every transport they end within seconds.

Zenoh itself waits ten seconds for each address of UDP and QUIC, and for a TCP port that is open and
silent. So a limit below ten tells the two apart, however busy the machine is.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from typer.testing import CliRunner

from heel.services.cli import app
from tests.support.network import free_port
from tests.support.processes import running

_ZENOHS_OWN_S = 10.0
TRANSPORTS = ("tcp", "tls", "quic", "udp", "ws")
VERBS = (
    ("follow", "none"), ("topics",), ("hz", "tracks"), ("echo", "tracks"), ("top",),
    ("swap", "tracker"), ("status", "--all"),
)  # fmt: skip


@pytest.fixture
def silent() -> Iterator[dict[str, str]]:
    """Ports of this machine that are open and never say a word."""
    with ExitStack() as stack:
        stream = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        datagrams = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        datagrams.bind(("127.0.0.1", 0))
        own = {
            True: f"127.0.0.1:{stream.getsockname()[1]}",
            False: f"127.0.0.1:{datagrams.getsockname()[1]}",
        }
        yield {one: own[one in ("tcp", "tls", "ws")] for one in TRANSPORTS}


def failed_within(*arguments: str) -> tuple[str, float]:
    """What a command says that has to fail, and how long it took."""
    started_s = time.monotonic()
    done = CliRunner().invoke(app, list(arguments))
    assert done.exit_code != 0, done.output
    return f"{done.output}{done.exception or ''}", time.monotonic() - started_s


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_status_ends_soon_where_nobody_listens(transport: str) -> None:
    endpoint = f"{transport}/127.0.0.1:{free_port()}"
    said, seconds = failed_within("status", "--connect", endpoint)
    assert endpoint in said
    assert seconds < _ZENOHS_OWN_S, said


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_status_ends_soon_where_somebody_listens_and_is_silent(
    transport: str, silent: dict[str, str]
) -> None:
    endpoint = f"{transport}/{silent[transport]}"
    said, seconds = failed_within("status", "--connect", endpoint)
    assert endpoint in said
    assert seconds < _ZENOHS_OWN_S, said


@pytest.mark.parametrize("verb", VERBS, ids=" ".join)
def test_every_verb_ends_soon(verb: tuple[str, ...]) -> None:
    endpoint = f"udp/127.0.0.1:{free_port()}"
    said, seconds = failed_within(*verb, "--connect", endpoint)
    assert endpoint in said
    assert seconds < _ZENOHS_OWN_S, said


def test_two_addresses_take_no_longer_than_one() -> None:
    endpoints = ",".join(f"udp/127.0.0.1:{free_port()}" for _ in range(4))
    _, seconds = failed_within("status", "--connect", endpoints)
    assert seconds < _ZENOHS_OWN_S


@pytest.mark.parametrize("verb", ["status", "stop", "resume"])
def test_nothing_holds_up_the_end_of_the_process(verb: str) -> None:
    # The whole command in a process of its own: a thread that is left would keep it.
    endpoint = f"udp/127.0.0.1:{free_port()}"
    with running("-m", "heel.services.cli", verb, "--connect", endpoint) as process:
        assert process.wait(_ZENOHS_OWN_S) == 1
        assert verb == "resume" or endpoint in process.stderr()
