"""HTTP on the loopback for the tests: every path is a function that answers."""

from __future__ import annotations

import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

Answer = Callable[["Request"], None]


class Request(BaseHTTPRequestHandler):
    """One request, with what the answers need."""

    protocol_version = "HTTP/1.1"
    stopping: threading.Event

    def do_GET(self) -> None:
        server = self.server
        assert isinstance(server, _Server)
        self.stopping = server.stopping
        answer = server.answers.get(self.path.partition("?")[0])
        self.close_connection = True
        try:
            if answer is None:
                self.send_error(404)
            else:
                server.requests.append(self.path)
                answer(self)
        except OSError:
            return

    def log_message(self, format: str, *args: object) -> None:
        """Nothing on stderr."""

    def start_pictures(self) -> None:
        """The head of an MJPEG stream."""
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.send_header("Connection", "close")
        self.end_headers()

    def send_picture(self, jpeg: bytes) -> None:
        """One part of it."""
        head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
        self.wfile.write(head.encode() + jpeg + b"\r\n")
        self.wfile.flush()

    def send_body(self, body: bytes, kind: str = "application/octet-stream") -> None:
        """A whole body, or the range that was asked for."""
        start = int(self.headers.get("Range", "bytes=0-").removeprefix("bytes=").split("-")[0])
        self.send_response(206 if "Range" in self.headers else 200)
        if "Range" in self.headers:
            self.send_header("Content-Range", f"bytes {start}-{len(body) - 1}/{len(body)}")
        self.send_header("Accept-Ranges", "bytes")
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body) - start))
        self.end_headers()
        self.wfile.write(body[start:])


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False
    answers: dict[str, Answer]
    requests: list[str]
    stopping: threading.Event


class HttpServer:
    """Serves `answers` until the end of the block."""

    def __init__(self, answers: dict[str, Answer]) -> None:
        self._server = _Server(("127.0.0.1", 0), Request)
        self._server.answers, self._server.requests = answers, []
        self._server.stopping = threading.Event()
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))

    @property
    def requests(self) -> list[str]:
        """Paths asked for so far that there are."""
        return self._server.requests

    def address(self, path: str, user: str = "") -> str:
        """Of a path, with `user:password` where given."""
        return f"http://{user}{'@' if user else ''}127.0.0.1:{self._server.server_port}{path}"

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._server.stopping.set()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(5.0)


def numbered_jpeg(number: int) -> bytes:
    """`numbered_picture` as a JPEG."""
    return cv2.imencode(".jpg", numbered_picture(number))[1].tobytes()


def numbered_picture(number: int) -> NDArray[np.uint8]:
    """A picture that tells its number by a row of light and dark fields; see `number_of`."""
    image = np.full((64, 256, 3), 120, np.uint8)
    image[40:, ::8] = 20
    for bit in range(16):
        image[:32, bit * 16 : bit * 16 + 16] = 255 if number >> bit & 1 else 0
    return image


def number_of(image: NDArray[np.uint8]) -> int:
    """The number in a picture of `numbered_picture`."""
    fields = image[8:24].reshape(16, 16, 16, 3)[:, :, 4:12].mean(axis=(0, 2, 3))
    return sum(1 << bit for bit in range(16) if fields[bit] > 128)
