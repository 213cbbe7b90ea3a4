"""What every page of Heel's keeps to: who may come in, who is logged in, what is served to whom."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from importlib import resources
from typing import Any, ClassVar

from aiohttp import web

from heel.services.web.connections import HEADERS, Connections
from heel.services.web.guard import HostGuard
from heel.services.web.hub import Hub
from heel.services.web.login import LONGEST_S, Login, Session
from heel.services.web.requests import MAX_BODY_BYTES, BadRequestError, credentials
from heel.services.web.worker import BusyError, Worker

_FOR_ALL = frozenset(
    ("/login.html", "/login.js", "/style.css", "/icon.svg", "/healthz", "/api/login")
)
"""What is served without a login."""
MOST_LOGINS = 4
"""Passwords that are checked or wait for it; more are refused as busy. Chosen by hand."""
HUNG_S = 2.0
"""Seconds without a turn of the service loop from which the page says that it hangs."""
_BODY_TIMEOUT_S = 2.0
"""Seconds that a client has to send a request's body; chosen by hand."""
_TYPES = {"html": "text/html", "css": "text/css", "js": "text/javascript", "svg": "image/svg+xml"}
SOCKETS = web.AppKey("sockets", set[web.WebSocketResponse])
"""WebSockets that are open."""
_Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


@dataclass(frozen=True)
class Door:
    """The way in: checks every request, logs people in and out, serves files.

    A page is a subclass that says what else there is.
    """

    hub: Hub
    guard: HostGuard
    connections: Connections
    login: Login | None = None
    """None: everybody that reaches the page may do everything."""
    checks: Worker | None = None
    """Checks passwords, which takes a while."""
    tls: bool = False

    PAGE: ClassVar[str] = "index.html"
    """The file that is served at `/`."""
    FILES: ClassVar[tuple[str, ...]] = ()
    """Its files, beside those of the login."""
    TO_OPERATE: ClassVar[frozenset[str]] = frozenset()
    """What those that are logged in to watch may not ask for."""

    def routes(self) -> list[web.RouteDef]:
        """What there is beside files and the login."""
        return []

    def application(self) -> web.Application:
        """The aiohttp application."""
        app = web.Application(client_max_size=MAX_BODY_BYTES, middlewares=[self._protect])
        app.on_response_prepare.append(_add_headers)
        files = ("style.css", "login.html", "login.js", "session.js", "icon.svg", self.PAGE)
        app.add_routes([web.get("/", _static(self.PAGE))])
        app.add_routes([web.get(f"/{name}", _static(name)) for name in (*files, *self.FILES)])
        app.add_routes(
            [
                web.get("/healthz", self._healthz),
                web.get("/api/session", self._session),
                web.post("/api/login", self._log_in),
                web.post("/api/logout", self._log_out),
                *self.routes(),
            ]
        )
        return app

    @web.middleware
    async def _protect(self, request: web.Request, handler: _Handler) -> web.StreamResponse:
        self.connections.used(request.protocol)
        refusal = self.guard.refusal(request.headers, request.path)
        if refusal is not None:
            return refused(403, refusal)
        if self.login is not None and request.path not in _FOR_ALL:
            session = self.session_of(request)
            if session is None and request.path in ("/", f"/{self.PAGE}"):
                raise web.HTTPSeeOther("/login.html")
            if session is None:
                return refused(401, "log in first")
            if session.role != "operate" and request.path in self.TO_OPERATE:
                return refused(403, f"{session.user} is logged in to watch: operators may do this")
        try:
            return await handler(request)
        except web.HTTPException as error:
            return refused(error.status, error.text or error.reason)
        except BadRequestError as error:
            return refused(400, str(error))
        except BusyError as error:
            return refused(429, str(error))

    def session_of(self, request: web.Request) -> Session | None:
        if self.login is None:
            return None
        token = request.cookies.get(self._cookie)
        return self.login.sessions.find(token, time.monotonic())

    @property
    def _cookie(self) -> str:
        """Its name; browsers let nothing but this very host over TLS set one that begins so."""
        return "__Host-heel" if self.tls else "heel"

    async def _session(self, request: web.Request) -> web.Response:
        session = self.session_of(request)
        if session is None:
            return web.json_response({"login": False})
        return web.json_response({"login": True, "user": session.user, "role": session.role})

    async def _log_in(self, request: web.Request) -> web.Response:
        user, password = credentials(await body_of(request))
        if self.login is None or self.checks is None:
            return refused(404, "nobody logs in here")
        login, address, now_s = self.login, request.remote or "unknown", time.monotonic()
        if wait_s := login.attempts.wait_s(address, user, now_s):
            self._say_of_login(f"attempt for {user!r} from {address} refused: too many")
            return refused(429, f"too many wrong attempts: wait {math.ceil(wait_s)} s")
        # Noted before it is checked, so that many at once count as many.
        login.attempts.failed(address, user, now_s)
        with self.connections.kept(request.protocol):
            role = await asyncio.wrap_future(
                self.checks.submit(lambda: login.role_of(user, password))
            )
        if role is None:
            self._say_of_login(f"wrong name or password for {user!r} from {address}")
            return refused(403, "wrong name or password")
        login.attempts.right(address, user)
        self._say_of_login(f"{user!r} logged in from {address}, role {role}")
        response = web.json_response({"role": role})
        response.set_cookie(
            self._cookie, login.sessions.begin(user, role, time.monotonic()),
            httponly=True, samesite="Strict", secure=self.tls, path="/", max_age=int(LONGEST_S),
        )  # fmt: skip
        return response

    async def _log_out(self, request: web.Request) -> web.Response:
        if self.login is not None:
            self.login.sessions.end(request.cookies.get(self._cookie))
        response = web.json_response({})
        response.del_cookie(
            self._cookie, path="/", httponly=True, samesite="Strict", secure=self.tls
        )
        return response

    def _say_of_login(self, words: str) -> None:
        self.connections.warn.warning("login", words, time.monotonic())

    async def _healthz(self, _request: web.Request) -> web.Response:
        _, age_s = self.hub.status()
        if age_s > HUNG_S:
            return refused(503, f"the service loop has hung for {age_s:.1f} s")
        return web.json_response({"ok": True, "viewers": self.hub.viewer_count})


async def body_of(request: web.Request) -> bytes:
    """A request's body, which has to be JSON and to come in time."""
    if request.content_type != "application/json":
        raise web.HTTPUnsupportedMediaType(text="send Content-Type: application/json")
    try:
        async with asyncio.timeout(_BODY_TIMEOUT_S):
            return await request.read()
    except TimeoutError:
        raise web.HTTPRequestTimeout(text="the body did not come in time") from None


async def _add_headers(_request: web.Request, response: web.StreamResponse) -> None:
    for name, value in HEADERS.items():
        response.headers[name] = value


def _static(name: str) -> Callable[[web.Request], Awaitable[web.Response]]:
    # Read once: the pages then work from a read-only root, a wheel or a zip alike.
    body = resources.files("heel.services.web").joinpath("static", name).read_bytes()
    content_type = _TYPES[name.rpartition(".")[2]]
    charset = None if content_type.startswith("image/") else "utf-8"

    async def serve(_request: web.Request) -> web.Response:
        return web.Response(body=body, content_type=content_type, charset=charset)

    return serve


def refused(status: int, reason: str) -> web.Response:
    """A refusal, as JSON."""
    payload: dict[str, Any] = {"error": " ".join(reason.split())[:300]}
    return web.json_response(payload, status=status)
