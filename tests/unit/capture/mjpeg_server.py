"""A camera on the loopback: MJPEG over HTTP that can stall, hang up, refuse and come back."""

from __future__ import annotations

from typing import Literal

import cv2

from tests.unit.capture.http_server import HttpServer, Request
from tests.unit.capture.videos import picture

Behaviour = Literal["stream", "stall", "hang up", "refuse"]
_PATH = "/video.mjpg"


class MjpegServer(HttpServer):
    """Serves numbered pictures at 50 frames/s; `behaviour` may be changed while it runs."""

    def __init__(self) -> None:
        super().__init__({_PATH: self._serve})
        self.behaviour: Behaviour = "stream"
        self.video = self.address(_PATH)

    def _serve(self, request: Request) -> None:
        """One client, until it leaves or the behaviour ends it."""
        if self.behaviour == "refuse":
            request.send_error(503)
            return
        request.start_pictures()
        number = 0
        while not request.stopping.wait(0.02) and self.behaviour in ("stream", "stall"):
            if self.behaviour == "stream":
                number = (number + 1) % 10
                request.send_picture(cv2.imencode(".jpg", picture(number))[1].tobytes())
