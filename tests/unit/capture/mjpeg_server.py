"""A camera on the loopback: MJPEG over HTTP that can stall, hang up, refuse and come back."""

from __future__ import annotations

import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from typing import Literal, Self

import cv2

from tests.unit.capture.videos import picture

Behaviour = Literal["stream", "stall", "hang up", "refuse"]


class MjpegServer:
    """Serves numbered pictures at 50 frames/s; `behaviour` may be changed while it runs."""

    def __init__(self) -> None:
        self.behaviour: Behaviour = "stream"
        self.requests = 0
        self.stopping = threading.Event()
        owner = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                owner.serve(self)

            def log_message(self, format: str, *args: object) -> None:
                """Nothing on stderr."""

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        self._server.block_on_close = False
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))
        self.address = f"http://127.0.0.1:{self._server.server_port}/video.mjpg"

    def serve(self, request: BaseHTTPRequestHandler) -> None:
        """One client, until it leaves or the behaviour ends it."""
        self.requests += 1
        if self.behaviour == "refuse":
            request.send_error(503)
            return
        request.send_response(200)
        request.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        request.end_headers()
        number = 0
        try:
            while not self.stopping.wait(0.02) and self.behaviour in ("stream", "stall"):
                if self.behaviour == "stall":
                    continue
                number = (number + 1) % 10
                data = cv2.imencode(".jpg", picture(number))[1].tobytes()
                head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
                request.wfile.write(head.encode() + data + b"\r\n")
        except OSError:
            return

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.stopping.set()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(5.0)
