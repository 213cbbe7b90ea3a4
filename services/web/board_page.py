"""The page beside which a calibration board is held up: the camera's picture, what of it is covered
by now, and where the board is wanted next.

It only shows: the command that looks for the board (`heel calibrate board`) says what.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, ClassVar

import cv2
import numpy as np
from aiohttp import web
from numpy.typing import NDArray

from heel.services.web.connections import Connections, room_for_connections
from heel.services.web.door import Door, refused
from heel.services.web.guard import HostGuard
from heel.services.web.hub import Hub
from heel.services.web.server import ServerThread, listen

_HOST = "127.0.0.1"
_WATCHED_S = 2.0
"""Seconds for which a viewer that has asked counts as there; chosen by hand."""
_SHOWN_PX = 960
"""Width of the picture on the page at most; chosen by hand."""
_QUALITY = 80
"""Of its JPEG, percent; chosen by hand."""
_LAST_S = 3.0
"""Longest wait [s] for viewers to fetch how it ended: three looks of a page. Chosen by hand."""


class BoardPreview:
    """The newest picture with what is known of it, from the command's thread to the server's."""

    def __init__(self) -> None:
        self.hub = Hub(1)
        self._lock = threading.Lock()
        self._picture: NDArray[np.uint8] | None = None
        self._state: dict[str, Any] = {"number": 0}
        self._asked_s = -np.inf
        self._fetched = threading.Event()

    def show(self, picture: NDArray[np.uint8], state: dict[str, Any]) -> None:
        """Put a picture, (H, W, 3) BGR that nobody writes to, in place of the one before."""
        with self._lock:
            self._picture = picture
            self._state = state | {"number": self._state["number"] + 1}
        self.hub.put_note("status", {})

    def end(self, result: str) -> None:
        """Say how it ended, and wait until viewers know, if there are any."""
        self._fetched.clear()
        with self._lock:
            self._state |= {"result": result}
            watched = time.monotonic() - self._asked_s < _WATCHED_S
        if watched:
            self._fetched.wait(_LAST_S)

    def state(self) -> dict[str, Any]:
        """What is known of the newest picture."""
        with self._lock:
            self._asked_s = time.monotonic()
            return dict(self._state)

    def told(self) -> None:
        """A viewer has what `state` gave last."""
        self._fetched.set()

    def jpeg(self) -> bytes | None:
        """The newest picture; None before the first."""
        with self._lock:
            picture = self._picture
        if picture is None:
            return None
        height, width = picture.shape[:2]
        if width > _SHOWN_PX:
            size = _SHOWN_PX, max(1, round(height * _SHOWN_PX / width))
            picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
        _, coded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        return coded.tobytes()


@dataclass(frozen=True)
class BoardSite(Door):
    """The preview, as a page, a picture and JSON."""

    preview: BoardPreview = field(default_factory=BoardPreview)

    PAGE: ClassVar[str] = "board.html"
    FILES: ClassVar[tuple[str, ...]] = ("board.js",)

    def routes(self) -> list[web.RouteDef]:
        """Picture and state."""
        return [web.get("/api/board", self._board), web.get("/board.jpg", self._jpeg)]

    async def _board(self, _request: web.Request) -> web.Response:
        state = self.preview.state()
        if "result" in state:
            self.preview.told()
        return web.json_response(state)

    async def _jpeg(self, _request: web.Request) -> web.Response:
        picture = self.preview.jpeg()
        if picture is None:
            return refused(404, "no picture so far")
        return web.Response(body=picture, content_type="image/jpeg")


@contextmanager
def board_page(port: int, log: logging.Logger) -> Iterator[tuple[str, BoardPreview]]:
    """Serve the preview on loopback while the block runs; its address, and what it shows.

    Raises:
        HeelError: the port is taken.
    """
    preview = BoardPreview()
    listener = listen(_HOST, port)
    port = listener.getsockname()[1]
    site = BoardSite(
        hub=preview.hub, guard=HostGuard(_HOST, port, (), open_to_network=False),
        connections=Connections(room_for_connections(), log), preview=preview,
    )  # fmt: skip
    with ServerThread(site, listener, log):
        yield f"http://{_HOST}:{port}/", preview
