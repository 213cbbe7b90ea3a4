"""The page's HTTP and WebSocket interface."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from importlib import resources
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from heel.schemas import MessageError
from heel.services.web.connections import HEADERS, Connections
from heel.services.web.control import (
    Control,
    NoFollowerError,
    RouterAwayError,
    TargetRefusedError,
)
from heel.services.web.guard import HostGuard
from heel.services.web.hub import Hub, Viewer
from heel.services.web.login import LONGEST_S, Login, Session
from heel.services.web.requests import (
    MAX_BODY_BYTES,
    BadRequestError,
    acknowledged_number,
    credentials,
    target_request,
)
from heel.services.web.worker import BusyError, Worker

STATIC_FILES = {
    "index.html": "text/html",
    "style.css": "text/css",
    "app.js": "text/javascript",
    "picture.js": "text/javascript",
    "panel.js": "text/javascript",
    "people.js": "text/javascript",
    "above.js": "text/javascript",
    "link.js": "text/javascript",
    "login.html": "text/html",
    "login.js": "text/javascript",
    "session.js": "text/javascript",
    "icon.svg": "image/svg+xml",
}
_FOR_ALL = frozenset(
    ("/login.html", "/login.js", "/style.css", "/icon.svg", "/healthz", "/api/login")
)
"""What is served without a login."""
_TO_OPERATE = frozenset(("/api/target", "/api/stop", "/api/resume"))
MOST_LOGINS = 4
"""Passwords that are checked or wait for it; more are refused as busy. Chosen by hand."""
HUNG_S = 2.0
"""Seconds without a turn of the service loop from which the page says that it hangs."""
_BODY_TIMEOUT_S = 2.0
"""Seconds that a client has to send a request's body; chosen by hand."""
_STOP_TIMEOUT_S = 1.0
"""Seconds until STOP is answered, sent or not; it takes milliseconds."""
_SNAPSHOT_TIMEOUT_S = 2.0
"""Seconds that a snapshot waits for a picture; chosen by hand."""
_HEARTBEAT_S = 5.0
"""Seconds between two signs of life on an idle stream; chosen by hand."""
_Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


@dataclass(frozen=True, slots=True)
class Site:
    """What the handlers work with."""

    hub: Hub
    control: Control
    guard: HostGuard
    connections: Connections
    login: Login | None = None
    """None: everybody that reaches the page may do everything."""
    checks: Worker | None = None
    """Checks passwords, which takes a while."""
    tls: bool = False

    def application(self) -> web.Application:
        """The aiohttp application."""
        app = web.Application(client_max_size=MAX_BODY_BYTES, middlewares=[self._protect])
        app.on_response_prepare.append(_add_headers)
        app.add_routes([web.get("/", _static("index.html"))])
        app.add_routes([web.get(f"/{name}", _static(name)) for name in STATIC_FILES])
        app.add_routes(
            [
                web.get("/ws", self._viewer),
                web.get("/healthz", self._healthz),
                web.get("/snapshot.jpg", self._snapshot),
                web.get("/api/state", self._state),
                web.get("/api/session", self._session),
                web.post("/api/login", self._log_in),
                web.post("/api/logout", self._log_out),
                web.post("/api/target", self._target),
                web.post("/api/stop", self._stop),
                web.post("/api/resume", self._resume),
            ]
        )
        return app

    @web.middleware
    async def _protect(self, request: web.Request, handler: _Handler) -> web.StreamResponse:
        self.connections.used(request.protocol)
        refusal = self.guard.refusal(request.headers, request.path)
        if refusal is not None:
            return _error(403, refusal)
        if self.login is not None and request.path not in _FOR_ALL:
            session = self._session_of(request)
            if session is None and request.path in ("/", "/index.html"):
                raise web.HTTPSeeOther("/login.html")
            if session is None:
                return _error(401, "log in first")
            if session.role != "operate" and request.path in _TO_OPERATE:
                return _error(403, f"{session.user} is logged in to watch: operators may do this")
        try:
            return await handler(request)
        except web.HTTPException as error:
            return _error(error.status, error.text or error.reason)
        except BadRequestError as error:
            return _error(400, str(error))
        except BusyError as error:
            return _error(429, str(error))

    def _session_of(self, request: web.Request) -> Session | None:
        if self.login is None:
            return None
        token = request.cookies.get(self._cookie)
        return self.login.sessions.find(token, time.monotonic())

    @property
    def _cookie(self) -> str:
        """Its name; browsers let nothing but this very host over TLS set one that begins so."""
        return "__Host-heel" if self.tls else "heel"

    async def _session(self, request: web.Request) -> web.Response:
        session = self._session_of(request)
        if session is None:
            return web.json_response({"login": False})
        return web.json_response({"login": True, "user": session.user, "role": session.role})

    async def _log_in(self, request: web.Request) -> web.Response:
        user, password = credentials(await _body(request))
        if self.login is None or self.checks is None:
            return _error(404, "nobody logs in here")
        login, address, now_s = self.login, request.remote or "unknown", time.monotonic()
        if wait_s := login.attempts.wait_s(address, user, now_s):
            self._say_of_login(f"attempt for {user!r} from {address} refused: too many")
            return _error(429, f"too many wrong attempts: wait {math.ceil(wait_s)} s")
        # Noted before it is checked, so that many at once count as many.
        login.attempts.failed(address, user, now_s)
        with self.connections.kept(request.protocol):
            role = await asyncio.wrap_future(
                self.checks.submit(lambda: login.role_of(user, password))
            )
        if role is None:
            self._say_of_login(f"wrong name or password for {user!r} from {address}")
            return _error(403, "wrong name or password")
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
            return _error(503, f"the service loop has hung for {age_s:.1f} s")
        return web.json_response({"ok": True, "viewers": self.hub.viewer_count})

    async def _state(self, _request: web.Request) -> web.Response:
        status, age_s = self.hub.status()
        return web.json_response(status | {"status_age_s": round(age_s, 3)})

    async def _snapshot(self, _request: web.Request) -> web.Response:
        # Takes none of the viewers' places: all that wait get the same picture.
        frame = await self.hub.next_frame(_SNAPSHOT_TIMEOUT_S)
        if frame is None:
            return _error(503, f"no picture within {_SNAPSHOT_TIMEOUT_S:g} s: is capture running?")
        return web.Response(
            body=frame.jpeg,
            content_type="image/jpeg",
            headers={"X-Heel-Seq": str(frame.header["seq"])},
        )

    async def _target(self, request: web.Request) -> web.Response:
        wanted = target_request(await _body(request))
        control = self.control
        try:
            target = await asyncio.wrap_future(
                control.choices.submit(lambda: control.choose(wanted))
            )
        except TargetRefusedError as error:
            return _error(409, str(error))
        except NoFollowerError as error:
            return _error(504, str(error))
        except MessageError as error:
            return _error(502, str(error))
        return web.json_response(target.model_dump())

    async def _stop(self, request: web.Request) -> web.Response:
        # Whatever the body says: nothing but a wrong origin keeps a stop from going out.
        control, who = self.control, request.remote or "unknown"
        with self.connections.kept(request.protocol):
            control.stop_is_asked_for()
            try:
                sending = asyncio.wrap_future(control.stops.submit(lambda: control.stop(who)))
                await asyncio.wait_for(asyncio.shield(sending), _STOP_TIMEOUT_S)
            except TimeoutError:
                return _error(504, "the stop has not gone out yet; it will be repeated")
            except BusyError:
                # As many stops as may wait are on their way already, and one is enough.
                pass
        return web.json_response({"connected": control.connected})

    async def _resume(self, request: web.Request) -> web.Response:
        await _body(request)
        control, who = self.control, request.remote or "unknown"
        stops_before = control.stops_asked_for
        resume = control.resumes.submit(lambda: control.resume(who, stops_before))
        try:
            await asyncio.wrap_future(resume)
        except RouterAwayError as error:
            return _error(503, str(error))
        return web.json_response({"connected": True})

    async def _viewer(self, request: web.Request) -> web.StreamResponse:
        socket = web.WebSocketResponse(
            heartbeat=_HEARTBEAT_S, timeout=0.5, max_msg_size=1024, compress=False
        )
        if not socket.can_prepare(request):
            return _error(426, "this address speaks WebSocket only")
        with self.hub.viewer() as viewer:
            if viewer is None:
                return _error(503, "all viewers' places are taken: raise --max-viewers")
            with self.connections.kept(request.protocol):
                await socket.prepare(request)
                request.app[SOCKETS].add(socket)
                may_go_on = self._may_go_on(request)
                sending = asyncio.create_task(_send(socket, viewer, may_go_on))
                try:
                    await _receive(socket, viewer)
                finally:
                    request.app[SOCKETS].discard(socket)
                    sending.cancel()
                    await asyncio.wait([sending])
        return socket

    def _may_go_on(self, request: web.Request) -> Callable[[], bool]:
        """Whether a viewer's login still holds; using the page keeps it."""
        return lambda: self.login is None or self._session_of(request) is not None


SOCKETS = web.AppKey("sockets", set[web.WebSocketResponse])


async def _send(
    socket: web.WebSocketResponse, viewer: Viewer, may_go_on: Callable[[], bool]
) -> None:
    queue = viewer.queue
    try:
        while not socket.closed:
            await viewer.news.wait()
            viewer.news.clear()
            if not may_go_on():
                await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=b"logged out")
                return
            while (note := queue.take_note()) is not None:
                await socket.send_str(note)
            if (taken := queue.take_frame()) is not None:
                number, frame = taken
                await socket.send_bytes(frame.pack(number, queue.dropped))
    except ConnectionError:
        # The viewer left while something was on its way to it.
        return


async def _receive(socket: web.WebSocketResponse, viewer: Viewer) -> None:
    async for message in socket:
        try:
            if message.type is not WSMsgType.TEXT:
                raise BadRequestError('viewers send {"ack": number} and nothing else')
            if not viewer.queue.acknowledge(acknowledged_number(message.data)):
                raise BadRequestError("acknowledged a picture that was not sent")
        except BadRequestError as error:
            await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=str(error).encode()[:120])
            return
        viewer.news.set()


async def _body(request: web.Request) -> bytes:
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
    content_type = STATIC_FILES[name]
    charset = None if content_type.startswith("image/") else "utf-8"

    async def serve(_request: web.Request) -> web.Response:
        return web.Response(body=body, content_type=content_type, charset=charset)

    return serve


def _error(status: int, reason: str) -> web.Response:
    payload: dict[str, Any] = {"error": " ".join(reason.split())[:300]}
    return web.json_response(payload, status=status)
