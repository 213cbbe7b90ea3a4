"""The web service under test, a drawn stream for it, and a browser to look at it."""

from __future__ import annotations

import shutil
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Self

import cv2
import numpy as np
import pytest
import zenoh

from heel.schemas import EndOfStream, Header, Stamp, Track, Tracks, encode, keys
from heel.schemas.image import JPEG, RAW, encode_image
from tests.support.network import wait_until
from tests.support.processes import Running, running

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

TRACKER = "tracker/main@0123abcd"
WIDTH_PX, HEIGHT_PX = 480, 240
STEP_PX = 30
BOX_PX = (60, 120)
WALKER, STANDER = 1, 7
STANDER_BOX = (400.0, 100.0, 440.0, 220.0)
_BROWSER_FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--window-size=1280,900",
)  # fmt: skip


def walker_box(seq: int) -> tuple[float, float, float, float]:
    """Where the walking person is in a frame: 30 px further in each."""
    left = 20.0 + (seq * STEP_PX) % 300
    return left, 60.0, left + BOX_PX[0], 60.0 + BOX_PX[1]


@contextmanager
def web_process(endpoint: str, *arguments: str) -> Iterator[tuple[str, Running]]:
    """The web service on a free port; its address without the last slash, and its process."""
    flags = ("--connect", endpoint, "--port", "0", *arguments)
    with running("-m", "heel.services.web", *flags) as process:
        wait_until(lambda: "page at " in process.stderr() or not process.alive, "the page", 40.0)
        assert process.alive, process.stderr()
        yield process.stderr().partition("page at ")[2].split('/"')[0], process


class DrawnStream(threading.Thread):
    """Sends frames with a bright walker on dark ground, and tracks two frames later.

    Use as a context manager.
    """

    def __init__(
        self, session: zenoh.Session, epoch: int = 1, rate_hz: float = 20.0,
        with_tracks: bool = True, encoding: str = RAW, camera: str = "front",
    ) -> None:  # fmt: skip
        super().__init__(name="drawn-stream", daemon=True)
        self._epoch, self._period_s = epoch, 1.0 / rate_hz
        self._with_tracks, self._encoding, self._camera = with_tracks, encoding, camera
        self._images = session.declare_publisher(keys.image(camera))
        self._tracks = session.declare_publisher(keys.tracks(camera))
        self._done = threading.Event()
        self.sent = 0

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        tb: TracebackType | None,
    ) -> None:  # fmt: skip
        self._done.set()
        self.join(5.0)

    def run(self) -> None:
        while not self._done.wait(self._period_s):
            self._send_image(self.sent)
            if self._with_tracks and self.sent >= 2:
                self._send_tracks(self.sent - 2)
            self.sent += 1

    def end(self, reason: str) -> None:
        """Stop sending and announce the end."""
        self._done.set()
        self.join(5.0)
        end = EndOfStream(stream=self._camera, epoch=self._epoch, frames=self.sent, reason=reason)
        self._images.put(encode(end), encoding=end.encoding())

    def _send_image(self, seq: int) -> None:
        pixels = np.full((HEIGHT_PX, WIDTH_PX, 3), 20, np.uint8)
        for box in (walker_box(seq), STANDER_BOX):
            left, top, right, bottom = (int(side) for side in box)
            cv2.rectangle(pixels, (left, top), (right - 1, bottom - 1), (235, 235, 235), -1)
        header = Header(
            stream=self._camera, epoch=self._epoch, seq=seq, index=seq, t_capture_ns=seq,
            width=WIDTH_PX, height=HEIGHT_PX, source_width=WIDTH_PX, source_height=HEIGHT_PX,
            image_encoding=RAW if self._encoding == RAW else JPEG,
            producer="capture/main@0123abcd",
        )  # fmt: skip
        self._images.put(
            encode_image(pixels, self._encoding),
            encoding=self._encoding, attachment=encode(header),
        )  # fmt: skip

    def _send_tracks(self, seq: int) -> None:
        people = (_track(WALKER, walker_box(seq)), _track(STANDER, STANDER_BOX))
        message = Tracks(
            stream=self._camera, epoch=self._epoch, seq=seq, index=seq, t_capture_ns=seq,
            width=WIDTH_PX, height=HEIGHT_PX, source_width=WIDTH_PX, source_height=HEIGHT_PX,
            tracks=people,
        )  # fmt: skip
        stamp = Stamp(producer=TRACKER, t_sent_ns=time.time_ns(), age_ns=0)
        self._tracks.put(encode(message), encoding=message.encoding(), attachment=encode(stamp))


def _track(identity: int, box: tuple[float, float, float, float]) -> Track:
    return Track(
        id=identity, state="tracked", box_xyxy=box, velocity_pxps=(0.0, 0.0), area_px=100.0,
        span_px=10.0, identity_confidence=0.9, shown=True,
    )  # fmt: skip


@contextmanager
def browser() -> Iterator[Chrome]:
    """Headless Chromium with a profile of its own; skips the test where there is none."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip("needs chromium and chromedriver on the PATH")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        for flag in (*_BROWSER_FLAGS, f"--user-data-dir={profile}"):
            options.add_argument(flag)
        chrome = webdriver.Chrome(options, webdriver.ChromeService(driver))
        try:
            chrome.set_page_load_timeout(20)
            chrome.set_script_timeout(20)
            yield chrome
        finally:
            chrome.quit()
