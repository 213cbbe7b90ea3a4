"""The page under attack: nothing that holds connections, floods or stammers keeps off a STOP."""

from __future__ import annotations

import json
import resource
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from heel.schemas import EStop, decode, keys
from heel.services.web.connections import IDLE_S, MOST_CONNECTIONS
from tests.support.network import client, collected, router, wait_until
from tests.support.processes import Running
from tests.support.web_client import DEADLINE_S, post
from tests.support.web_page import web_process

DESCRIPTORS = 512
STOP_WITHIN_S = 3.0
"""Of the time that a machine under load may take; it is some milliseconds."""


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    with router() as address:
        yield address


@pytest.fixture
def page(endpoint: str) -> Iterator[tuple[str, Running]]:
    with web_process(endpoint) as (url, process):
        # As few as a careless system gives.
        resource.prlimit(process.process.pid, resource.RLIMIT_NOFILE, (DESCRIPTORS, DESCRIPTORS))
        yield url, process


def connect(url: str) -> socket.socket:
    one = socket.create_connection(("127.0.0.1", int(url.rpartition(":")[2])), DEADLINE_S)
    one.settimeout(DEADLINE_S)
    return one


def stop(url: str) -> float:
    """Seconds that a STOP took to be answered."""
    started_s = time.monotonic()
    assert post(f"{url}/api/stop", b"{}")[0] == 200
    return time.monotonic() - started_s


@pytest.mark.parametrize(
    "words",
    [pytest.param(b"", marks=pytest.mark.slow), b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-slow: "],
)
def test_a_thousand_connections_that_ask_for_nothing_hold_up_no_stop(
    endpoint: str, page: tuple[str, Running], words: bytes
) -> None:
    url, process = page
    with ExitStack() as stack, client(endpoint) as session:
        stops = stack.enter_context(collected(session, keys.FOLLOW_ESTOP))
        held = []
        for _ in range(1200):
            held.append(stack.enter_context(connect(url)))
            held[-1].sendall(words)
        assert stop(url) < STOP_WITHIN_S
        sample = stops.get(timeout=DEADLINE_S)
        assert decode(EStop, sample.payload.to_bytes(), str(sample.encoding)).engaged
        assert _open(held) <= MOST_CONNECTIONS
        wait_until(lambda: _open(held) == 0, "the end of them all", IDLE_S + DEADLINE_S)
        assert len(process.stderr()) < 10_000
        assert process.alive


def _open(held: list[socket.socket]) -> int:
    """How many of these the page has not closed."""
    count = 0
    for one in held:
        one.setblocking(False)
        try:
            count += one.recv(1) != b""
        except BlockingIOError:
            count += 1
        except OSError:
            pass
    return count


def test_whoever_does_not_read_the_answers_is_let_go(page: tuple[str, Running]) -> None:
    url, _ = page
    host = url.removeprefix("http://")
    asked = f"GET /panel.js HTTP/1.1\r\nHost: {host}\r\n\r\n".encode() * 400
    with connect(url) as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        deaf.settimeout(0.5)
        ended = False
        until_s = time.monotonic() + 30.0
        while not ended and time.monotonic() < until_s:
            try:
                deaf.sendall(asked)
            except TimeoutError:
                continue
            except OSError:
                ended = True
        assert ended
    assert stop(url) < STOP_WITHIN_S


def test_what_is_no_http_is_answered_whole_and_logged_in_few_short_lines(
    page: tuple[str, Running],
) -> None:
    url, process = page
    host = url.removeprefix("http://")
    before = len(process.stderr())
    answer = b""
    for words in (
        b"FOO / HTTP/1.1\r\n\r\n" * 1,
        f"GET / HTTP/1.1\r\nHost: {host}\r\nHost: evil.example\r\n\r\n".encode(),
        b"GET /" + b"A" * 20_000 + b" HTTP/1.1\r\n\r\n",
        f"POST /api/target HTTP/1.1\r\nHost: {host}\r\nContent-Length: 4\r\n"
        "Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n".encode(),
        b"\x16\x03\x01\x1b[2J\r\n\r\n",
    ):
        for _ in range(40):
            with connect(url) as rude:
                rude.sendall(words)
                answer = rude.recv(4096)
                assert answer.startswith(b"HTTP/1.")
                assert int(answer.split()[1]) in (400, 403, 414)
                head = answer.partition(b"\r\n\r\n")[0].decode().lower()
                assert "content-security-policy" in head
                assert "nosniff" in head
                assert "aiohttp" not in head
    written = process.stderr()[before:]
    assert "Traceback" not in written
    assert len(written) < 10_000
    assert all(json.loads(line) for line in written.splitlines())


def test_a_flood_of_resumes_takes_no_place_of_a_stop(page: tuple[str, Running]) -> None:
    url, process = page
    before = len(process.stderr())
    host = url.removeprefix("http://")
    body = "Content-Type: application/json\r\nContent-Length: 2\r\n\r\n{}"
    with ExitStack() as stack:
        for _ in range(60):
            flood = stack.enter_context(connect(url))
            flood.sendall(f"POST /api/resume HTTP/1.1\r\nHost: {host}\r\n{body}".encode() * 20)
        assert stop(url) < STOP_WITHIN_S
    assert len(process.stderr()) - before < 20_000
