"""Cameras: one thread reads, the newest frame wins, a lost connection is taken up again."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace

from heel.schemas.errors import SourceError
from heel.services.capture.backoff import Backoff
from heel.services.capture.device import Device, Picture, RecordingEnded
from heel.services.capture.frozen import NewsWatch
from heel.services.capture.source import (
    Frame,
    FrameSource,
    SourceStatus,
    SourceTimeout,
    Warn,
    log_warning,
    plausible_fps,
)

Connect = Callable[[], Device]
"""Opens the camera or raises SourceError; may block for some seconds."""

_BEHIND_S = 0.3
"""Pictures later than this are told of as late; chosen by hand."""
_CAUGHT_UP_S = 0.15
"""Until they are no later than this; chosen by hand."""
_BEHIND = (
    f"its pictures come more than {_BEHIND_S:g} s late: the camera, the link or this processor "
    "does not keep up; ask the camera for fewer or smaller pictures"
)


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
        stop: ends the wait for the first frame at once.
        patience_s: how long the constructor waits where data comes, but no picture yet.

    Raises:
        SourceError: the first attempt failed, gave no frame in time or was stopped.
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
        stop: threading.Event | None = None,
        patience_s: float = 0.0,
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
        self._device: Device | None = None
        self._newest: Frame | None = None
        self._status = SourceStatus(state="reconnecting")
        self._count = 0
        self._first_ns = self._last_ns = self._taken_ns = 0
        self._ended = ""
        self._news = NewsWatch()
        self._thread = threading.Thread(target=self._run, name="camera-reader", daemon=True)
        self._thread.start()
        self._await_first_frame(open_timeout_s, patience_s, stop or threading.Event())

    def read(self, timeout_s: float = 5.0) -> Frame | None:
        """The newest frame not yet read, None once closed.

        Raises:
            SourceTimeout: none came within `timeout_s` seconds.
        """
        with self._changed:
            self._changed.wait_for(
                lambda: self._newest is not None or self._ended or self._closing.is_set(), timeout_s
            )
            frame, self._newest = self._newest, None
            if self._closing.is_set() or (frame is None and self._ended):
                self.end_reason = self._ended or "closed"
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
            device = self._device
        if device is not None:
            device.interrupt()
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=0.5)

    @property
    def status(self) -> SourceStatus:
        """Connected, stalled, reconnecting or frozen, and why."""
        with self._changed:
            if self._closing.is_set():
                return replace(self._status, state="closed")
            silent_s = (time.monotonic_ns() - self._last_ns) / 1e9
            if self._status.state != "reconnecting" and silent_s > self._stall_after_s:
                why = self._complaint() or "the camera is silent"
                return replace(self._status, state="stalled", last_error=why)
            return self._status

    def _complaint(self) -> str:
        return "" if self._device is None else self._device.complaint

    def _await_first_frame(
        self, timeout_s: float, patience_s: float, stop: threading.Event
    ) -> None:
        started_s, told = time.monotonic(), ""
        with self._changed:
            while not (self._newest or self._status.attempt or stop.is_set()):
                self._changed.wait(0.05)
                waited_s, complaint = time.monotonic() - started_s, self._complaint()
                if waited_s > timeout_s and (not complaint or waited_s > timeout_s + patience_s):
                    break
                if waited_s > timeout_s and complaint != told:
                    self._warn(f"{self.name}: {complaint}; waiting on")
                    told = complaint
            first, error = self._newest, self._status.last_error or self._complaint()
        if first is None:
            waited_s = time.monotonic() - started_s
            self.close()
            if stop.is_set():
                raise SourceError(
                    f"{self.name}: no picture within {waited_s:.1f} s, when told to end"
                )
            if self.name in error:
                raise SourceError(error)
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
            except RecordingEnded as end:
                with self._changed:
                    self._ended = str(end)
                    self._changed.notify_all()
                return
            except SourceError as problem:
                error = " ".join(str(problem).split())
            attempt = 1 if self._count > count_before else attempt + 1
            self._report_loss(attempt, error)
            if self._closing.wait(self._backoff.delay_s(attempt)):
                return

    def _stream(self) -> str:
        """Deliver pictures until the connection breaks; the reason why it did."""
        device = self._connect()
        with self._changed:
            self._device = device
        try:
            if self._count == 0:
                self.fps = plausible_fps(device.fps, self.name, self._warn)
            while not self._closing.is_set():
                self._deliver(device.read())
            return "closed"
        finally:
            with self._changed:
                self._device = None
            device.close()

    def _deliver(self, picture: Picture) -> None:
        height, width = picture.image.shape[:2]
        returned = False
        with self._changed:
            now_ns = time.monotonic_ns()
            # A newer picture is no older than the last, whatever its time stamp makes of it.
            taken_ns = self._taken_ns = max(self._taken_ns, min(picture.taken_ns, now_ns))
            self._first_ns = self._first_ns or taken_ns
            media_time_s = (taken_ns - self._first_ns) / 1e9
            if self._status.state == "reconnecting" and self._count:
                returned = True
                self._news.reset()
                self._status = replace(
                    self._status, attempt=0, reconnects=self._status.reconnects + 1
                )
            since_ns = self._news.update(picture.image, taken_ns)
            self._count += picture.skipped if self._count else 0
            self._newest = Frame(
                picture.image, self._count, media_time_s, width, height, taken_ns, since_ns
            )
            self._count += 1
            self._last_ns = now_ns
            self._judge((taken_ns - since_ns) / 1e9, (now_ns - taken_ns) / 1e9)
            self._changed.notify_all()
        if returned:
            self._warn(f"{self.name}: connected again")

    def _judge(self, still_s: float, late_s: float) -> None:
        """Say in the status whether the newest picture shows anything new, and is new."""
        limit_s = _CAUGHT_UP_S if self._status.state == "behind" else _BEHIND_S
        if still_s >= self._frozen_after_s:
            self._status = replace(self._status, state="frozen", last_error=self._news.complaint)
        elif late_s > limit_s:
            self._status = replace(self._status, state="behind", last_error=_BEHIND)
        else:
            self._status = replace(self._status, state="connected")

    def _report_loss(self, attempt: int, error: str) -> None:
        with self._changed:
            if self._closing.is_set():
                return
            self._status = replace(
                self._status, state="reconnecting", attempt=attempt, last_error=error
            )
            self._changed.notify_all()
        if attempt == 1 and self._count:
            told = error if self.name in error else f"{self.name}: {error}"
            self._warn(f"{told}; connecting again")
