"""From the service loop to the viewers: one bounded bridge into asyncio, then a queue each."""

from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal

from heel.services.web.frames import ViewFrame
from heel.services.web.viewer import ViewerQueue

NoteKind = Literal["status", "sim-world", "sim-truth"]
"""JSON objects that viewers get beside the pictures; newcomers get the last of each kind."""


_FRESH_S = 0.2
"""A picture that is no older is one of this moment."""


class Viewer:
    """A viewer's queue and the signal that something is in it. Lives in the asyncio loop."""

    def __init__(self, max_in_flight: int = 2) -> None:
        self.queue = ViewerQueue(max_in_flight)
        self.news = asyncio.Event()


class Hub:
    """Newest-wins slots that the service loop fills and the asyncio loop empties.

    `put_*` are called by the service loop's thread; everything else by the asyncio loop's.

    Args:
        max_viewers: viewers at the same time.
    """

    def __init__(self, max_viewers: int) -> None:
        self._max_viewers = max_viewers
        self._viewers: set[Viewer] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._lock = threading.Lock()
        self._frame: ViewFrame | None = None
        self._notes: dict[NoteKind, dict[str, Any]] = {}
        self._kept: dict[NoteKind, str] = {}
        self._scheduled = False
        self._last_status: dict[str, Any] = {}
        self._last_status_s = time.monotonic()
        self.viewer_count = 0
        self._newest: tuple[ViewFrame, float] | None = None
        self._waiting = 0
        self._awaited: asyncio.Future[ViewFrame] | None = None
        self.watched = False
        """Read by the service loop: while no viewer is there nothing is coded."""

    def attach(self, loop: asyncio.AbstractEventLoop | None) -> None:
        """Deliver into this loop from now on; None stops that."""
        with self._lock:
            self._loop = loop
            self._scheduled = False
            self._wake()

    def put_frame(self, frame: ViewFrame) -> None:
        """Hand over a picture, in place of one that has not been fetched yet."""
        with self._lock:
            self._frame = frame
            self._wake()

    def put_note(self, kind: NoteKind, note: dict[str, Any]) -> None:
        """Hand over a note, in place of one of its kind that has not been fetched yet."""
        with self._lock:
            self._notes[kind] = note
            self._wake()

    def _wake(self) -> None:
        # At most one call waits in the asyncio loop, however busy that is.
        if self._loop is not None and not self._scheduled:
            self._scheduled = True
            self._loop.call_soon_threadsafe(self._deliver)

    def _deliver(self) -> None:
        with self._lock:
            frame, self._frame = self._frame, None
            notes, self._notes = self._notes, {}
            self._scheduled = False
        if "status" in notes:
            self._last_status, self._last_status_s = notes["status"], time.monotonic()
        texts = {kind: json.dumps(note, separators=(",", ":")) for kind, note in notes.items()}
        self._kept |= texts
        if frame is not None:
            self._newest = (frame, time.monotonic())
            if self._awaited is not None and not self._awaited.done():
                self._awaited.set_result(frame)
        for viewer in self._viewers:
            if frame is not None:
                viewer.queue.offer_frame(frame)
            for kind, text in texts.items():
                viewer.queue.offer_note(kind, text)
            viewer.news.set()

    @contextmanager
    def viewer(self) -> Iterator[Viewer | None]:
        """A place among the viewers, None if all are taken."""
        if len(self._viewers) >= self._max_viewers:
            yield None
            return
        viewer = Viewer()
        for kind, text in self._kept.items():
            viewer.queue.offer_note(kind, text)
        viewer.news.set()
        self._viewers.add(viewer)
        self._count()
        try:
            yield viewer
        finally:
            self._viewers.discard(viewer)
            self._count()

    async def next_frame(self, timeout_s: float) -> ViewFrame | None:
        """A picture of this moment, None if there is none within `timeout_s`.

        However many wait, they wait for one and the same.
        """
        if self._newest is not None and time.monotonic() - self._newest[1] < _FRESH_S:
            return self._newest[0]
        if self._awaited is None or self._awaited.done():
            self._awaited = asyncio.get_running_loop().create_future()
        awaited = self._awaited
        self._waiting += 1
        self._count()
        try:
            return await asyncio.wait_for(asyncio.shield(awaited), timeout_s)
        except TimeoutError:
            return None
        finally:
            self._waiting -= 1
            self._count()

    def _count(self) -> None:
        self.viewer_count = len(self._viewers)
        self.watched = bool(self._viewers or self._waiting)

    def status(self) -> tuple[dict[str, Any], float]:
        """The last status and its age in seconds: a loop that hangs shows by it."""
        return self._last_status, time.monotonic() - self._last_status_s
