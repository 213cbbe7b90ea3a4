"""A server of files on loopback that behaves as badly as it is told to."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

_RATE_BYTES = 4096


@dataclass
class Behaviour:
    """What the server does; the requests that it has got are noted.

    Attributes:
        content: of the file at any path.
        ranges: whether it honours Range.
        break_after: bytes after which each connection breaks; None: none does.
        breaks: connections that break; later ones do not.
        length: whether it says how long the file is.
        redirects: times that it sends a client elsewhere first.
        status: other than 200.
        claimed_length: in place of the length.
        asked: the Range header of every request, "" for none.
    """

    content: bytes
    ranges: bool = True
    break_after: int | None = None
    breaks: int = 10**9
    length: bool = True
    redirects: int = 0
    status: int = 200
    claimed_length: int | None = None
    asked: list[str] = field(default_factory=list)


class _Handler(BaseHTTPRequestHandler):
    behaviour: Behaviour

    def log_message(self, *_: object) -> None:
        """Nothing is printed."""

    def do_GET(self) -> None:
        told = self.behaviour
        if told.redirects > 0:
            told.redirects -= 1
            self.send_response(302)
            self.send_header("Location", f"/again{told.redirects}")
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        wanted = self.headers.get("Range", "")
        told.asked.append(wanted)
        first = int(wanted.removeprefix("bytes=").rstrip("-")) if wanted and told.ranges else 0
        if first >= len(told.content) > 0:
            self.send_error(416)
            return
        body = told.content[first:]
        self.send_response(206 if first and told.status == 200 else told.status)
        if first:
            last = len(told.content) - 1
            self.send_header("Content-Range", f"bytes {first}-{last}/{len(told.content)}")
        if told.length:
            self.send_header("Content-Length", str(told.claimed_length or len(body)))
        self.end_headers()
        if told.break_after is not None and told.breaks > 0:
            told.breaks -= 1
            body = body[: told.break_after]
        self.wfile.write(body)


@contextmanager
def served(behaviour: Behaviour) -> Iterator[str]:
    """Serve; yields the address of a file."""
    handler = type("Handler", (_Handler,), {"behaviour": behaviour})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/model.onnx"
        finally:
            server.shutdown()
            thread.join(5)
