"""A network camera on the loopback that can freeze, go black, go silent or lose its person."""

from __future__ import annotations

import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Event, Thread
from typing import Literal, Self

import cv2
import numpy as np

from heel.services.capture.scene import Scene, SceneSettings
from heel.services.capture.scene.settings import SceneName

View = Literal["person", "nobody", "black", "frozen", "silent", "stalled"]
"""`stalled`: nothing for two seconds, then all that waited at once, then nothing."""
FPS = 25.0
_SIZE = {"width": 480, "height": 360}
STALL_S = 2.0
_QUIET_FRAMES = 50
"""Of the empty scene, each with noise of its own; played again and again."""


def _drawn(name: SceneName, frames: int | None = None) -> list[bytes]:
    scene = Scene(SceneSettings(name=name, fps=FPS, frames=frames, shadows=False, **_SIZE))
    return [_jpeg(scene.frame(index)) for index in range(scene.frame_count)]


def _jpeg(image: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> bytes:
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()


def _part(data: bytes) -> bytes:
    head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
    return head.encode() + data + b"\r\n"


class FaultyCamera:
    """MJPEG over HTTP, 480x360 at 25 frames/s, of somebody who paces to and fro.

    Use as a context manager; `view` may be changed at any time.
    """

    def __init__(self) -> None:
        self.view: View = "person"
        self._pictures = {"person": _drawn("pacing"), "nobody": _drawn("empty", _QUIET_FRAMES)}
        self._shown = {"person": 0, "nobody": 0}
        self._black = _jpeg(np.zeros((_SIZE["height"], _SIZE["width"], 3), np.uint8))
        self._ending = Event()
        owner = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                owner._serve(self)

            def log_message(self, format: str, *args: object) -> None:
                """Nothing on stderr."""

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        self._server.block_on_close = False
        self._thread = Thread(target=self._server.serve_forever, args=(0.05,), daemon=True)
        self.address = f"http://127.0.0.1:{self._server.server_port}/camera.mjpg"

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(5.0)

    def _serve(self, request: BaseHTTPRequestHandler) -> None:
        """One client, until it leaves."""
        request.send_response(200)
        request.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        request.end_headers()
        started_s, sent, data = time.monotonic(), 0, self._black
        kept: list[bytes] = []
        try:
            while not self._ending.wait(max(0.0, started_s + sent / FPS - time.monotonic())):
                sent += 1
                view = self.view
                if view == "silent":
                    continue
                if view == "stalled":
                    if len(kept) < STALL_S * FPS:
                        kept.append(_part(self._picture("person")))
                    elif len(kept) == STALL_S * FPS:
                        request.wfile.write(b"".join(kept))
                        kept.append(b"")
                    continue
                kept.clear()
                if view != "frozen":
                    data = self._picture(view)
                request.wfile.write(_part(data))
        except OSError:
            return

    def _picture(self, view: View) -> bytes:
        if view == "black":
            return self._black
        # The person waits where nobody looks, and is found again near the same place.
        self._shown[view] += 1
        pictures = self._pictures[view]
        return pictures[self._shown[view] % len(pictures)]
