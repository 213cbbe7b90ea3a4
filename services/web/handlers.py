"""The HTTP and WebSocket interface of one robot's page."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from aiohttp import WSCloseCode, WSMsgType, web

from heel.schemas import Manual, ManualGrant, MessageError
from heel.services.web.control import (
    Control,
    NoFollowerError,
    RouterAwayError,
    TargetRefusedError,
)
from heel.services.web.door import SOCKETS, Door, body_of, refused
from heel.services.web.hand import WISH_TTL_S, Beats, read_wish
from heel.services.web.hub import Viewer
from heel.services.web.requests import BadRequestError, acknowledged_number, target_request
from heel.services.web.worker import BusyError

_STOP_TIMEOUT_S = 1.0
"""Seconds until STOP is answered, sent or not; it takes milliseconds."""
_SNAPSHOT_TIMEOUT_S = 2.0
"""Seconds that a snapshot waits for a picture; chosen by hand."""
_HEARTBEAT_S = 5.0
"""Seconds between two signs of life on an idle stream; chosen by hand."""


@dataclass(frozen=True, kw_only=True)
class Site(Door):
    """What the handlers work with."""

    control: Control

    FILES: ClassVar[tuple[str, ...]] = (
        "app.js", "picture.js", "panel.js", "people.js", "above.js", "hand.js", "link.js",
    )  # fmt: skip
    TO_OPERATE: ClassVar[frozenset[str]] = frozenset(
        ("/api/target", "/api/stop", "/api/resume", "/api/hand-back", "/hand")
    )

    def routes(self) -> list[web.RouteDef]:
        """Pictures, state, choice, stop, release and driving by hand."""
        return [
            web.get("/ws", self._viewer),
            web.get("/snapshot.jpg", self._snapshot),
            web.get("/api/state", self._state),
            web.post("/api/target", self._target),
            web.post("/api/stop", self._stop),
            web.post("/api/resume", self._resume),
            web.post("/api/hand-back", self._hand_back),
            web.get("/hand", self._hand),
        ]

    async def _state(self, _request: web.Request) -> web.Response:
        status, age_s = self.hub.status()
        return web.json_response(status | {"status_age_s": round(age_s, 3)})

    async def _snapshot(self, _request: web.Request) -> web.Response:
        # Takes none of the viewers' places: all that wait get the same picture.
        frame = await self.hub.next_frame(_SNAPSHOT_TIMEOUT_S)
        if frame is None:
            return refused(503, f"no picture within {_SNAPSHOT_TIMEOUT_S:g} s: is capture running?")
        return web.Response(
            body=frame.jpeg,
            content_type="image/jpeg",
            headers={"X-Heel-Seq": str(frame.header["seq"])},
        )

    async def _target(self, request: web.Request) -> web.Response:
        wanted = target_request(await body_of(request))
        control = self.control
        try:
            target = await asyncio.wrap_future(
                control.choices.submit(lambda: control.choose(wanted))
            )
        except TargetRefusedError as error:
            return refused(409, str(error))
        except NoFollowerError as error:
            return refused(504, str(error))
        except MessageError as error:
            return refused(502, str(error))
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
                return refused(504, "the stop has not gone out yet; it will be repeated")
            except BusyError:
                # As many stops as may wait are on their way already, and one is enough.
                pass
        return web.json_response({"connected": control.connected})

    async def _resume(self, request: web.Request) -> web.Response:
        await body_of(request)
        control, who = self.control, request.remote or "unknown"
        stops_before = control.stops_asked_for
        resume = control.resumes.submit(lambda: control.resume(who, stops_before))
        try:
            await asyncio.wrap_future(resume)
        except RouterAwayError as error:
            return refused(503, str(error))
        return web.json_response({"connected": True})

    async def _hand_back(self, request: web.Request) -> web.Response:
        await body_of(request)
        control, who = self.control, request.remote or "unknown"
        try:
            await asyncio.wrap_future(control.hands.submit(lambda: control.hand_back(who)))
        except TargetRefusedError as error:
            return refused(409, str(error))
        except NoFollowerError as error:
            return refused(504, str(error))
        return web.json_response({})

    async def _hand(self, request: web.Request) -> web.StreamResponse:
        """Somebody drives by hand as long as this socket is open."""
        socket = web.WebSocketResponse(
            heartbeat=_HEARTBEAT_S, timeout=0.5, max_msg_size=256, compress=False
        )
        if not socket.can_prepare(request):
            return refused(426, "this address speaks WebSocket only")
        control, who = self.control, request.remote or "unknown"
        with self.connections.kept(request.protocol):
            await socket.prepare(request)
            request.app[SOCKETS].add(socket)
            try:
                grant = await asyncio.wrap_future(
                    control.hands.submit(lambda: control.take_by_hand(who))
                )
                await _drive(socket, control, grant, self._may_go_on(request))
            except (TargetRefusedError, NoFollowerError, MessageError, BusyError) as error:
                await _close(socket, str(error))
            finally:
                request.app[SOCKETS].discard(socket)
        return socket

    async def _viewer(self, request: web.Request) -> web.StreamResponse:
        socket = web.WebSocketResponse(
            heartbeat=_HEARTBEAT_S, timeout=0.5, max_msg_size=1024, compress=False
        )
        if not socket.can_prepare(request):
            return refused(426, "this address speaks WebSocket only")
        with self.hub.viewer() as viewer:
            if viewer is None:
                return refused(503, "all viewers' places are taken: raise --max-viewers")
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
        return lambda: self.login is None or self.session_of(request) is not None


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


async def _drive(
    socket: web.WebSocketResponse, control: Control, grant: ManualGrant,
    may_go_on: Callable[[], bool],
) -> None:  # fmt: skip
    """Pass on what the hand wishes; its end, whatever it is, is to let go."""
    beats, seq = Beats(), 0

    def wish(held: bool, forward: float, left: float, age_s: float) -> None:
        nonlocal seq
        said = Manual(grant=grant.grant or "", seq=seq, held=held, forward=forward, left=left,
                      ttl_s=WISH_TTL_S)  # fmt: skip
        control.wish(said, age_s)
        seq += 1

    try:
        await socket.send_json({"source": grant.source, "beat": beats.next(time.monotonic())})
        async for message in socket:
            try:
                if message.type is not WSMsgType.TEXT:
                    raise BadRequestError("wishes are text")
                said = read_wish(message.data)
            except BadRequestError as error:
                await _close(socket, str(error))
                return
            if not may_go_on():
                await _close(socket, "logged out")
                return
            now_s = time.monotonic()
            wish(said.held, said.forward, said.left, beats.age_s(said.beat, now_s))
            await socket.send_json({"beat": beats.next(now_s)})
    except ConnectionError:
        return
    finally:
        wish(False, 0.0, 0.0, 0.0)


async def _close(socket: web.WebSocketResponse, words: str) -> None:
    await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=words.encode()[:120])


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
