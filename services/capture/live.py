"""Cameras: one thread reads, the newest frame wins, a lost connection is taken up again."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from schemas.errors import SourceError
from services.capture.backoff import Backoff
from services.capture.frozen import NewsWatch
from services.capture.pixels import to_bgr8
from services.capture.source import (
    Frame,
    FrameSource,
    SourceStatus,
    SourceTimeout,
    Warn,
    log_warning,
    plausible_fps,
)


class Device(Protocol):
    """What a camera connection has to offer; `cv2.VideoCapture` does."""

    def read(self) -> tuple[bool, NDArray[np.integer | np.floating]]:
        """Block for the next picture; False when the connection is lost."""

    def get(self, prop: int, /) -> float:
        """A `cv2.CAP_PROP_*` value."""

    def release(self) -> None:
        """Close the connection."""


Connect = Callable[[], Device]
"""Opens the camera or raises SourceError; may block for some seconds."""


class LiveSource(FrameSource):
    """A camera that may stall, disconnect and come back.

    One daemon thread owns the connection and does every blocking call. `read` therefore always
    keeps its deadline, and `close` returns even when the thread is stuck inside a driver: such a
    thread releases the camera when the driver lets go of it, or ends with the process.

    Args:
        name: for people, without passwords.
        connect: opens the camera; called again after every loss.
        open_timeout_s: how long the constructor waits for the first frame.
        stall_after_s: without a frame for so long the status is `stalled`.
        frozen_after_s: without anything new to see for so long the status is `frozen`.
        backoff: pauses between attempts to connect again.
        warn: told once of every loss and every return.

    Raises:
        SourceError: the first attempt failed or gave no frame in time.
    """

    is_live = True

    def __init__(
        self,
        name: str,
        connect: Connect,
        open_timeout_s: float = 10.0,
        stall_after_s: float = 2.0,
        frozen_after_s: float = 2.0,
        backoff: Backoff | None = None,
        warn: Warn = log_warning,
    ) -> None:
        self.name = name
        self._connect = connect
        self._stall_after_s = stall_after_s
        self._frozen_after_s = frozen_after_s
        self._backoff = backoff or Backoff()
        self._warn = warn
        self._closing = threading.Event()
        self._changed = threading.Condition()
        # Everything below is guarded by the condition.
        self._newest: Frame | None = None
        self._status = SourceStatus(state="reconnecting")
        self._count = 0
        self._first_ns = 0
        self._last_ns = 0
        self._news = NewsWatch()
        self._thread = threading.Thread(target=self._run, name="camera-reader", daemon=True)
        self._thread.start()
        self._await_first_frame(open_timeout_s)

    def read(self, timeout_s: float = 5.0) -> Frame | None:
        """The newest frame not yet read, None once closed.

        Raises:
            SourceTimeout: none came within `timeout_s` seconds.
        """
        with self._changed:
            self._changed.wait_for(
                lambda: self._newest is not None or self._closing.is_set(), timeout_s
            )
            frame, self._newest = self._newest, None
            if self._closing.is_set():
                self.end_reason = "closed"
                return None
            if frame is None:
                reason = self._status.last_error or "the camera is silent"
                raise SourceTimeout(f"{self.name}: no frame for {timeout_s:g} s ({reason})")
            return frame

    def close(self) -> None:
        """Stop the thread; waits at most half a second for a driver that does not answer."""
        with self._changed:
            self._closing.set()
            self._changed.notify_all()
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=0.5)

    @property
    def status(self) -> SourceStatus:
        """Connected, stalled, reconnecting or frozen, and why."""
        with self._changed:
            if self._closing.is_set():
                return replace(self._status, state="closed")
            silent_s = (time.monotonic_ns() - self._last_ns) / 1e9
            if self._status.state == "connected" and silent_s > self._stall_after_s:
                return replace(self._status, state="stalled", last_error="the camera is silent")
            return self._status

    def _await_first_frame(self, timeout_s: float) -> None:
        with self._changed:
            self._changed.wait_for(lambda: self._newest or self._status.attempt, timeout_s)
            first, error = self._newest, self._status.last_error
        if first is None:
            self.close()
            raise SourceError(
                f"{self.name}: {error or f'no picture within {timeout_s:g} s'}; "
                "check the address, the cable and that no other program uses the camera"
            )
        self.width, self.height = first.source_width, first.source_height

    def _run(self) -> None:
        attempt = 0
        while not self._closing.is_set():
            count_before = self._count
            try:
                error = self._stream()
            except (SourceError, cv2.error) as problem:
                error = " ".join(str(problem).split())
            attempt = 1 if self._count > count_before else attempt + 1
            self._report_loss(attempt, error)
            if self._closing.wait(self._backoff.delay_s(attempt)):
                return

    def _stream(self) -> str:
        """Deliver pictures until the connection breaks; the reason why it did."""
        device = self._connect()
        try:
            if self._count == 0:
                stated = float(device.get(cv2.CAP_PROP_FPS))
                self.fps = plausible_fps(stated, self.name, self._warn)
            while not self._closing.is_set():
                done, picture = device.read()
                if not done:
                    return "the camera stopped delivering pictures"
                self._deliver(to_bgr8(picture), time.monotonic_ns())
            return "closed"
        finally:
            device.release()

    def _deliver(self, image: NDArray[np.uint8], now_ns: int) -> None:
        height, width = image.shape[:2]
        returned = False
        with self._changed:
            self._first_ns = self._first_ns or now_ns
            media_time_s = (now_ns - self._first_ns) / 1e9
            if self._status.state == "reconnecting" and self._count:
                returned = True
                self._news.reset()
                self._status = replace(
                    self._status, attempt=0, reconnects=self._status.reconnects + 1
                )
            since_ns = self._news.update(image, now_ns)
            self._newest = Frame(image, self._count, media_time_s, width, height, now_ns, since_ns)
            self._count += 1
            self._last_ns = now_ns
            frozen = now_ns - since_ns >= self._frozen_after_s * 1e9
            self._status = replace(self._status, state="frozen" if frozen else "connected")
            self._changed.notify_all()
        if returned:
            self._warn(f"{self.name}: connected again")

    def _report_loss(self, attempt: int, error: str) -> None:
        with self._changed:
            if self._closing.is_set():
                return
            self._status = replace(
                self._status, state="reconnecting", attempt=attempt, last_error=error
            )
            self._changed.notify_all()
        if attempt == 1 and self._count:
            self._warn(f"{self.name}: {error}; connecting again")
