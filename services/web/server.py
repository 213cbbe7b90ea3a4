"""The asyncio loop that serves the page, in a thread of its own."""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import logging
import socket
import ssl
import threading
import time
from pathlib import Path
from typing import Any

from aiohttp import WSCloseCode, web

from heel.schemas import HeelError, SettingsError
from heel.services.web.connections import IDLE_S, Connection
from heel.services.web.door import SOCKETS, Door
from heel.services.web.hub import Hub

_START_DEADLINE_S = 5.0
"""Seconds that the server's thread has to start; chosen by hand."""
_BACKLOG = 128
"""Connections that may wait to be accepted; chosen by hand."""
_HANDSHAKE_S = 3.0
"""Seconds that a client has for TLS; chosen by hand."""
_STOP_DEADLINE_S = 1.0
"""Seconds that the server's thread has to end: below the deadline of the process."""
_CLOSE_DEADLINE_S = 0.3
"""Seconds that open streams have to close; chosen by hand."""


def listen(host: str, port: int) -> socket.socket:
    """Bind and listen; from here on connections wait instead of being refused.

    Raises:
        HeelError: the port is taken, or the address is not this machine's.
    """
    try:
        address = ipaddress.ip_address("127.0.0.1" if host == "localhost" else host)
        family = socket.AF_INET6 if address.version == 6 else socket.AF_INET
        return socket.create_server((str(address), port), family=family)
    except ValueError:
        raise HeelError(f"web: host {host!r} is not an IP address: use e.g. 0.0.0.0") from None
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise HeelError(
                f"web: {host}:{port} is in use: end the other program, or choose another port "
                "with --port (0 picks a free one)"
            ) from None
        raise HeelError(f"web: cannot listen on {host}:{port}: {error.strerror}") from None


def tls_context(certificate: Path, key: Path | None) -> ssl.SSLContext:
    """What serves the page over TLS 1.2 or newer.

    Raises:
        SettingsError: a file cannot be read, or is no certificate with its key.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_cert_chain(certificate, key)
    except OSError as error:
        where = certificate if key is None else f"{certificate}, {key}"
        raise SettingsError(
            f"web: {where}: {error.strerror or error}: name a PEM file with a certificate and its "
            "key, or give --certificate-key"
        ) from None
    return context


class ServerThread(threading.Thread):
    """Serves a site until told to stop. Use as a context manager.

    Args:
        site: what is served.
        listener: a listening socket; closed at the end.
        log: told of failures.
        tls: certificate and key; None: served in the clear.
    """

    def __init__(
        self, site: Door, listener: socket.socket, log: logging.Logger,
        tls: ssl.SSLContext | None = None,
    ) -> None:  # fmt: skip
        super().__init__(name="web-server", daemon=True)
        self._site = site
        self._listener = listener
        self._log = log
        self._tls = tls
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stopping: asyncio.Event | None = None
        self._ready = threading.Event()

    def run(self) -> None:
        """Serve."""
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        hub: Hub = self._site.hub
        app = self._site.application()
        app[SOCKETS] = set()
        app.on_shutdown.append(_say_goodbye)
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=_CLOSE_DEADLINE_S)
        await runner.setup()
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(self._complain)
        accepting = await loop.create_server(
            lambda: self._connection(runner), sock=self._listener, backlog=_BACKLOG,
            ssl=self._tls,
            ssl_handshake_timeout=_HANDSHAKE_S if self._tls else None,
            ssl_shutdown_timeout=_CLOSE_DEADLINE_S if self._tls else None,
        )  # fmt: skip
        sweeping = asyncio.create_task(self._site.connections.keep_clean())
        self._loop, self._stopping = loop, asyncio.Event()
        hub.attach(self._loop)
        self._ready.set()
        try:
            await self._stopping.wait()
        finally:
            hub.attach(None)
            sweeping.cancel()
            accepting.close()
            await runner.cleanup()

    def _connection(self, runner: web.AppRunner) -> Connection:
        assert runner.server is not None
        return Connection(
            self._site.connections,
            runner.server,
            loop=asyncio.get_running_loop(),
            access_log=None,
            keepalive_timeout=IDLE_S,
            # How long an unread body is drained for, e.g. one that came with a STOP.
            lingering_time=_CLOSE_DEADLINE_S,
        )

    def _complain(self, _loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Say what asyncio has to say, e.g. that descriptors ran out, in one bounded line."""
        words = f"{context.get('message')} ({context.get('exception')!r:.200})"
        self._site.connections.warn.warning("asyncio", words, time.monotonic())

    def __enter__(self) -> ServerThread:
        self.start()
        if not self._ready.wait(_START_DEADLINE_S):
            raise HeelError("web: the server did not start: see the log above")
        return self

    def __exit__(self, *_: object) -> None:
        if self._loop is not None and self._stopping is not None:
            self._loop.call_soon_threadsafe(self._stopping.set)
        self.join(_STOP_DEADLINE_S)
        if self.is_alive():
            self._log.warning("the web server did not end within %g s", _STOP_DEADLINE_S)


async def _say_goodbye(app: web.Application) -> None:
    """Close every WebSocket; a viewer that does not read is not waited for."""
    sockets = app[SOCKETS]
    closing = [
        asyncio.create_task(socket.close(code=WSCloseCode.GOING_AWAY, message=b"service ends"))
        for socket in sockets
    ]
    if closing:
        await asyncio.wait(closing, timeout=_CLOSE_DEADLINE_S)
