from __future__ import annotations

import pytest

from heel.services.web.guard import HostGuard

LOOPBACK = HostGuard("127.0.0.1", 8470, (), open_to_network=False)
NAMED = HostGuard("127.0.0.1", 8470, ("robot.local", "robot.example:443"), open_to_network=False)
OPEN = HostGuard("0.0.0.0", 8470, (), open_to_network=True)
IPV6 = HostGuard("::1", 8470, (), open_to_network=False)


@pytest.mark.parametrize(
    ("guard", "host", "passes"),
    [
        (LOOPBACK, "127.0.0.1:8470", True),
        (LOOPBACK, "localhost:8470", True),
        (LOOPBACK, "LOCALHOST:8470", True),
        (LOOPBACK, "[::1]:8470", True),
        (LOOPBACK, "127.0.0.1:8471", False),
        (LOOPBACK, "127.0.0.1", False),
        (LOOPBACK, "evil.example:8470", False),
        (LOOPBACK, "127.0.0.1.evil.example:8470", False),
        (LOOPBACK, "192.168.1.7:8470", False),
        (LOOPBACK, "", False),
        (NAMED, "robot.local:8470", True),
        (NAMED, "robot.example:443", True),
        (NAMED, "robot.example:8470", False),
        (OPEN, "192.168.1.7:8470", True),
        (OPEN, "[fe80::1]:8470", True),
        (OPEN, "evil.example:8470", False),
        (IPV6, "[::1]:8470", True),
    ],
)
def test_only_our_own_names_may_be_asked_for(guard: HostGuard, host: str, passes: bool) -> None:
    assert (guard.refusal({"Host": host}, "/api/state") is None) is passes


@pytest.mark.parametrize(
    ("headers", "passes"),
    [
        ({}, True),
        ({"Origin": "http://127.0.0.1:8470"}, True),
        ({"Origin": "http://localhost:8470"}, False),
        ({"Origin": "http://evil.example"}, False),
        ({"Origin": "null"}, False),
        ({"Origin": "https://127.0.0.1:8470"}, False),
        ({"Origin": "evil://127.0.0.1:8470"}, False),
        ({"Origin": "127.0.0.1:8470"}, False),
        ({"Sec-Fetch-Site": "same-origin"}, True),
        ({"Sec-Fetch-Site": "cross-site"}, False),
        ({"Sec-Fetch-Site": "same-site"}, False),
    ],
)
def test_other_sites_may_not_act(headers: dict[str, str], passes: bool) -> None:
    refusal = LOOPBACK.refusal({"Host": "127.0.0.1:8470", **headers}, "/api/stop")
    assert (refusal is None) is passes


@pytest.mark.parametrize("path", ["/snapshot.jpg", "/api/state", "/healthz", "/ws", "/app.js"])
def test_no_other_site_gets_at_anything(path: str) -> None:
    headers = {"Host": "127.0.0.1:8470", "Sec-Fetch-Site": "cross-site"}
    assert LOOPBACK.refusal(headers, path) is not None
    assert LOOPBACK.refusal(headers | {"Sec-Fetch-Dest": "document"}, path) is not None


def test_a_link_from_another_site_may_open_the_page() -> None:
    headers = {"Host": "127.0.0.1:8470", "Sec-Fetch-Site": "cross-site"}
    assert LOOPBACK.refusal(headers | {"Sec-Fetch-Dest": "document"}, "/") is None
    assert LOOPBACK.refusal(headers | {"Sec-Fetch-Dest": "iframe"}, "/") is not None
    assert LOOPBACK.refusal(headers, "/") is not None


def test_a_proxy_with_a_certificate_may_stand_before_a_named_page() -> None:
    for scheme, passes in (("https", True), ("http", True), ("ftp", False)):
        headers = {"Host": "robot.local:8470", "Origin": f"{scheme}://robot.local:8470"}
        assert (NAMED.refusal(headers, "/api/stop") is None) is passes
