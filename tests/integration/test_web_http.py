"""The page's HTTP interface: what it serves, and whom and what it refuses."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Iterator

import aiohttp
import pytest

from tests.support.network import router
from tests.support.web_client import DEADLINE_S, get, post
from tests.support.web_page import web_process


@pytest.fixture(scope="module")
def page() -> Iterator[str]:
    with router() as endpoint, web_process(endpoint) as (url, _):
        yield url


@pytest.mark.parametrize(
    ("body", "status", "complaint"),
    [
        (b"{", 400, "not JSON"),
        (b'{"mode": "id"}', 400, "track_id"),
        (b'{"mode": "none", "x": 1}', 400, "unknown key 'x'"),
        (b"[" + b" " * 5000 + b"]", 413, "size"),
        (b'{"mode": "nearest"}', 504, "no answer from the follower"),
    ],
)
def test_choices_that_cannot_be_served_get_one_line(
    page: str, body: bytes, status: int, complaint: str
) -> None:
    code, error = post(f"{page}/api/target", body)
    assert code == status
    assert complaint in error
    assert "\n" not in error


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example:8470"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec-Fetch-Site": "cross-site"},
    ],
)
@pytest.mark.parametrize("path", ["/api/target", "/api/stop", "/api/resume"])
def test_other_sites_may_not_act(page: str, path: str, headers: dict[str, str]) -> None:
    code, error = post(page + path, b'{"mode": "none"}', **headers)
    assert code == 403
    assert error


def test_other_sites_may_not_watch(page: str) -> None:
    async def connect(headers: dict[str, str]) -> int:
        async with aiohttp.ClientSession() as session:
            with pytest.raises(aiohttp.WSServerHandshakeError) as caught:
                await session.ws_connect(f"{page}/ws", headers=headers)
            return caught.value.status

    assert asyncio.run(connect({"Origin": "http://evil.example"})) == 403
    assert asyncio.run(connect({"Host": "evil.example"})) == 403
    assert get(f"{page}/snapshot.jpg", Host="evil.example")[0] == 403
    code, headers, _ = get(f"{page}/snapshot.jpg", **{"Sec-Fetch-Site": "cross-site"})
    assert code == 403
    assert headers["Cross-Origin-Resource-Policy"] == "same-origin"


def test_posts_must_be_json(page: str) -> None:
    code, error = post(f"{page}/api/target", b"mode=none", **{"Content-Type": "text/plain"})
    assert (code, "application/json" in error) == (415, True)


def test_the_page_is_self_contained_and_locked_down(page: str) -> None:
    code, headers, body = get(page + "/")
    assert code == 200
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert "unsafe" not in headers["Content-Security-Policy"]
    assert headers["X-Content-Type-Options"] == "nosniff"
    for name in (
        "app.js",
        "link.js",
        "panel.js",
        "people.js",
        "picture.js",
        "style.css",
        "icon.svg",
    ):
        code, headers, content = get(f"{page}/{name}")
        assert code == 200, name
        assert b"https://" not in content, name
        body += content
    assert get(f"{page}/settings.py")[0] == 404
    assert get(f"{page}/../settings.py")[0] == 404
    assert get(f"{page}/healthz")[0] == 200
    assert get(f"{page}/ws")[0] == 426


def test_garbage_instead_of_http_ends_nothing(page: str) -> None:
    for garbage in (b"\x16\x03\x01\x02\x00", b"GET / HTTP/9.9\r\n\r\n", b"\r\n" * 100):
        with socket.create_connection(("127.0.0.1", int(page.rpartition(":")[2]))) as rude:
            rude.settimeout(DEADLINE_S)
            rude.sendall(garbage)
            rude.shutdown(socket.SHUT_WR)
            while rude.recv(4096):
                pass
    assert get(f"{page}/healthz")[0] == 200
