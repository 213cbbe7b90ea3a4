"""A client of the page: HTTP requests, and viewers that acknowledge what they get."""

from __future__ import annotations

import asyncio
import json
import urllib.error
import urllib.request
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import aiohttp

DEADLINE_S = 15.0


def get(url: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    return request("GET", url, None, headers)


def request(
    method: str, url: str, body: bytes | None, headers: dict[str, str]
) -> tuple[int, dict[str, str], bytes]:
    asked = urllib.request.Request(url, body, headers, method=method)
    try:
        with urllib.request.urlopen(asked, timeout=DEADLINE_S) as response:
            return response.status, dict(response.headers), response.read()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, dict(error.headers), error.read()


def post(url: str, body: bytes, **headers: str) -> tuple[int, str]:
    """Status and error text of a POST."""
    status, _, answer = request("POST", url, body, {"Content-Type": "application/json"} | headers)
    return status, json.loads(answer).get("error", "")


def status_of(url: str) -> dict[str, Any]:
    code, _, body = get(f"{url}/api/state")
    assert code == 200
    status: dict[str, Any] = json.loads(body)
    return status


@asynccontextmanager
async def viewing(url: str) -> AsyncIterator[aiohttp.ClientWebSocketResponse]:
    async with aiohttp.ClientSession() as session, session.ws_connect(f"{url}/ws") as viewer:
        yield viewer


async def next_frame(viewer: aiohttp.ClientWebSocketResponse) -> tuple[dict[str, Any], bytes]:
    """The next picture's header and JPEG; acknowledged."""
    async with asyncio.timeout(DEADLINE_S):
        while True:
            message = await viewer.receive()
            assert message.type in (aiohttp.WSMsgType.TEXT, aiohttp.WSMsgType.BINARY), message
            if message.type is aiohttp.WSMsgType.BINARY:
                length = int.from_bytes(message.data[:4], "big")
                header = json.loads(message.data[4 : 4 + length])
                await viewer.send_str(json.dumps({"ack": header["number"]}))
                return header, message.data[4 + length :]


def upgrade(url: str) -> bytes:
    """A WebSocket handshake of a client that will never read."""
    return (
        f"GET /ws HTTP/1.1\r\nHost: {url.removeprefix('http://')}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    ).encode()
