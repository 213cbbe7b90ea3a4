"""Connections to the page: how many there may be, and for how long.

A socket costs a client nothing. So there is an end to their number, and newcomers win: the
connection that has been of no use for longest gives way. A STOP always gets in.
"""

from __future__ import annotations

import asyncio
import logging
import resource
import time
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from aiohttp import web
from aiohttp.web_protocol import RequestHandler

from heel.services.runtime.logs import OncePerSecond

IDLE_S = 5.0
"""A connection that asks for nothing, or takes longer to ask, is closed."""
_STUCK_S = 6.0
"""Nor does any answer take so long; a client that does not read its own is let go."""
_SWEEP_S = 1.0
"""Seconds between two looks for connections that are to be closed; chosen by hand."""
MOST_CONNECTIONS = 256
"""Far more than 64 viewers need, far fewer than the 1,024 descriptors of most processes."""
_DESCRIPTORS = 4096
"""Open files that are asked for: connections, pictures and room to spare. Chosen by hand."""

HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
    "Cache-Control": "no-store",
    "Server": "heel",
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
}
"""Of every answer, also to what is no request."""


class Connections:
    """The connections that are open, the one used least recently first.

    Args:
        most: at the same time.
        log: told of refusals, once a second.
    """

    def __init__(self, most: int, log: logging.Logger) -> None:
        self._most = most
        self._open: OrderedDict[Connection, float] = OrderedDict()
        self._kept: set[Connection] = set()
        self.warn = OncePerSecond(log)

    def __len__(self) -> int:
        return len(self._open)

    def enter(self, connection: Connection) -> None:
        """A client has connected; another one may have to go."""
        self._open[connection] = time.monotonic()
        while len(self._open) > self._most:
            # The newest client is the last to go.
            longest = next((one for one in self._open if one not in self._kept), connection)
            self.warn.warning(
                "connections", f"more than {self._most} connections: the idlest one is closed",
                time.monotonic(),
            )  # fmt: skip
            self._end(longest)

    def leave(self, connection: Connection) -> None:
        """A connection has ended."""
        self._open.pop(connection, None)
        self._kept.discard(connection)

    def used(self, connection: object) -> None:
        """A request has come."""
        if isinstance(connection, Connection) and connection in self._open:
            self._open[connection] = time.monotonic()
            self._open.move_to_end(connection)

    @contextmanager
    def kept(self, connection: object) -> Iterator[None]:
        """Let a connection stay for a while: it has a viewer's place, or stops the robot."""
        if isinstance(connection, Connection) and connection in self._open:
            self._kept.add(connection)
        try:
            yield
        finally:
            self._kept.discard(connection)
            self.used(connection)

    def sweep(self, now_s: float) -> None:
        """Close what has been stuck for too long."""
        for connection, used_s in list(self._open.items()):
            if connection not in self._kept and now_s - used_s > _STUCK_S:
                self._end(connection)

    async def keep_clean(self) -> None:
        """Sweep once a second until cancelled."""
        while True:
            await asyncio.sleep(_SWEEP_S)
            self.sweep(time.monotonic())

    def _end(self, connection: Connection) -> None:
        self.leave(connection)
        # Not closed but aborted: what the client does not read would keep it open.
        if connection.transport is not None:
            connection.transport.abort()


class Connection(RequestHandler):
    """One connection, as aiohttp serves it, that is counted and has errors of one line."""

    __slots__ = ("_connections",)

    def __init__(self, connections: Connections, server: web.Server, **settings: Any) -> None:
        super().__init__(server, **settings)
        self._connections = connections

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """A client has connected."""
        super().connection_made(transport)
        self._connections.enter(self)

    def connection_lost(self, exc: BaseException | None) -> None:
        """They are gone."""
        self._connections.leave(self)
        super().connection_lost(exc)

    def log_exception(self, *args: Any, **kw: Any) -> None:
        """One bounded line in place of a traceback for each."""
        cause = kw.get("exc_info")
        words = f"{args[0] if args else 'error'} ({cause!r:.200})"
        self._connections.warn.warning("http", words, time.monotonic())

    def handle_error(
        self, request: web.BaseRequest, status: int = 500, exc: BaseException | None = None,
        message: str | None = None,
    ) -> web.StreamResponse:  # fmt: skip
        """Answer what is no request, or what a handler failed at."""
        known = " ".join((message or "").split())[:200]
        self._connections.warn.warning(
            f"http-{status}", f"answered {status}: {known or repr(exc)[:200]}", time.monotonic()
        )
        reason = "this is no HTTP request" if status == 400 else "it went wrong: see the log"
        response = web.json_response({"error": reason}, status=status, headers=HEADERS)
        response.force_close()
        return response


def room_for_connections() -> int:
    """Raise this process's limit of descriptors if it is low; how many connections fit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _DESCRIPTORS if hard == resource.RLIM_INFINITY else min(hard, _DESCRIPTORS)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        with suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
            soft = wanted
    # Half of them at most: the other half is for files, the bus and shared memory.
    return MOST_CONNECTIONS if soft == resource.RLIM_INFINITY else min(MOST_CONNECTIONS, soft // 2)
