"""Attacks on the page as it is served to a network: over TLS, with a login."""

from __future__ import annotations

import asyncio
import json
import socket
import ssl
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass

import aiohttp
import pytest

from heel.services.security.folder import SecurityFolder
from tests.support.network import router
from tests.support.processes import finished
from tests.support.web_client import DEADLINE_S
from tests.support.web_page import web_process

pytest.importorskip("cryptography", reason="the extra `secure` is not installed")

PASSWORD = "correct horse"
JSON = {"Content-Type": "application/json"}


@dataclass
class Page:
    """The page's address, and what trusts its certificate."""

    url: str
    trusted: ssl.SSLContext

    def ask(
        self, path: str, body: dict[str, object] | None = None, **headers: str
    ) -> tuple[int, dict[str, str], bytes]:
        content = None if body is None else json.dumps(body).encode()
        asked = urllib.request.Request(
            self.url + path, content, (JSON if body is not None else {}) | headers
        )
        try:
            with urllib.request.urlopen(
                asked, timeout=DEADLINE_S, context=self.trusted
            ) as response:
                return response.status, dict(response.headers), response.read()
        except urllib.error.HTTPError as error:
            with error:
                return error.code, dict(error.headers), error.read()

    def log_in(self, user: str, password: str = PASSWORD) -> str:
        """The cookie of somebody that has logged in."""
        code, headers, body = self.ask("/api/login", {"user": user, "password": password})
        assert code == 200, body
        return headers["Set-Cookie"].partition(";")[0]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    made = SecurityFolder.create(tmp_path_factory.mktemp("security") / "keys")
    for user, role in (("anna", "operate"), ("ben", "watch"), ("carl", "watch")):
        made.set_login(user, "operate" if role == "operate" else "watch", PASSWORD)
    flags = ("--host", "0.0.0.0", "--users-file", str(made.folder / "page-users"),
             "--certificate", str(made.folder / "page.pem"))  # fmt: skip
    with router() as endpoint, web_process(endpoint, *flags) as (url, _):
        trusted = ssl.create_default_context(cafile=made.folder / "authority.crt")
        yield Page(f"https://localhost:{url.rpartition(':')[2]}", trusted)


def test_without_a_login_there_is_the_login_and_nothing_else(page: Page) -> None:
    code, _, body = page.ask("/")
    assert (code, b'id="password"' in body) == (200, True)
    for path in ("/api/state", "/snapshot.jpg", "/ws", "/api/session", "/app.js", "/panel.js"):
        assert page.ask(path)[0] == 401, path
    for path in ("/api/stop", "/api/resume", "/api/target"):
        assert page.ask(path, {})[0] == 401, path
        assert page.ask(path, {}, Cookie="__Host-heel=guess; heel=guess")[0] == 401, path


def test_a_cookie_is_out_of_reach_of_scripts_other_sites_and_plain_http(page: Page) -> None:
    _, headers, _ = page.ask("/api/login", {"user": "anna", "password": PASSWORD})
    name, *flags = headers["Set-Cookie"].split("; ")
    assert name.startswith("__Host-heel=")
    assert {"HttpOnly", "Secure", "SameSite=Strict", "Path=/"} <= set(flags)
    with socket.create_connection(("127.0.0.1", int(page.url.rpartition(":")[2]))) as plain:
        plain.settimeout(DEADLINE_S)
        plain.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert b"HTTP" not in plain.recv(100)


def test_who_watches_sees_and_changes_nothing(page: Page) -> None:
    ben = page.log_in("ben")
    assert page.ask("/api/state", Cookie=ben)[0] == 200
    assert json.loads(page.ask("/api/session", Cookie=ben)[2])["role"] == "watch"
    for path in ("/api/stop", "/api/resume", "/api/target"):
        code, _, body = page.ask(path, {"mode": "none"}, Cookie=ben)
        assert (code, b"to watch" in body) == (403, True), path
    anna = page.log_in("anna")
    assert page.ask("/api/stop", {}, Cookie=anna)[0] == 200


def test_another_site_may_not_use_the_login_of_a_browser(page: Page) -> None:
    anna = page.log_in("anna")
    for headers in (
        {"Origin": "https://evil.example"}, {"Origin": page.url.replace("https", "http")},
        {"Sec-Fetch-Site": "cross-site"}, {"Host": "evil.example"},
    ):  # fmt: skip
        assert page.ask("/api/stop", {}, Cookie=anna, **headers)[0] == 403, headers
        assert page.ask("/api/login", {}, **headers)[0] == 403, headers
    assert page.ask("/api/stop", {}, Cookie=anna, Origin=page.url)[0] == 200


def test_a_viewer_that_logs_out_is_shown_nothing_more(page: Page) -> None:
    async def watch() -> int | None:
        cookie = page.log_in("anna")
        async with aiohttp.ClientSession(headers={"Cookie": cookie}) as session:
            async with session.ws_connect(f"{page.url}/ws", ssl=page.trusted) as viewer:
                await viewer.receive(DEADLINE_S)
                await asyncio.to_thread(page.ask, "/api/logout", {}, Cookie=cookie)
                async with asyncio.timeout(DEADLINE_S):
                    while not viewer.closed:
                        await viewer.receive()
                assert page.ask("/api/state", Cookie=cookie)[0] == 401
                return viewer.close_code

    # The reason is lost where the connection ends before it is read.
    ended = {aiohttp.WSCloseCode.POLICY_VIOLATION, aiohttp.WSCloseCode.ABNORMAL_CLOSURE}
    assert asyncio.run(watch()) in ended


def test_guessing_is_slowed_down_and_hurts_nobody_that_is_logged_in(page: Page) -> None:
    anna = page.log_in("anna")
    begun_s, wrong, code = time.monotonic(), 0, 403
    while code == 403:
        code = page.ask("/api/login", {"user": "carl", "password": f"wrong {wrong}"})[0]
        wrong += code == 403
    # One more for every twelve seconds that a busy machine took.
    assert 5 <= wrong <= 5 + (time.monotonic() - begun_s) / 12
    assert code == 429
    # The right one neither: what is refused unread tells nothing.
    code, _, body = page.ask("/api/login", {"user": "carl", "password": PASSWORD})
    assert (code, b"wait" in body) == (429, True)
    assert page.ask("/api/stop", {}, Cookie=anna)[0] == 200
    for body in ({}, {"user": 1, "password": "x"}, {"user": "x", "password": "x", "more": 1}):
        assert page.ask("/api/login", body)[0] == 400


def test_a_page_for_a_network_without_login_or_tls_does_not_start() -> None:
    for flags in ((), ("--users-file", "users"), ("--certificate", "page.pem")):
        code, _, said = finished("-m", "heel.services.web", "--host", "0.0.0.0", *flags)
        assert (code, "--users-file and --certificate" in said) == (2, True), said
