"""A TCP relay on the loopback whose link can go dead without a word, as a radio link does."""

from __future__ import annotations

import queue
import socket
import time
from contextlib import suppress
from threading import Event, Lock, Thread
from typing import Self

_BYTES = 1 << 16
_MOST_ON_THE_WAY = 4096


class Relay:
    """Passes connections on to a port of this machine. Use as a context manager.

    Args:
        target_port: where connections go on to.
    """

    def __init__(self, target_port: int) -> None:
        self._target_port = target_port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._lock = Lock()
        self._dead = False
        self._moving = Event()
        self._moving.set()
        self.delay_s = 0.0
        """Of each way. May be changed at any time."""
        self.bytes_per_s: float | None = None
        """What each way takes."""
        self._ends: list[socket.socket] = []
        self._thread = Thread(target=self._accept, daemon=True)
        self.port: int = self._listener.getsockname()[1]

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._moving.set()
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._hang_up()
        self._thread.join(5.0)

    def cut(self) -> None:
        """From now on everything disappears, in both directions, and nobody is told."""
        self._dead = True

    def stall(self) -> None:
        """From now on nothing is taken: what is sent piles up, as towards a host that is gone."""
        self._moving.clear()

    def mend(self) -> None:
        """Hang up what was cut or stalled and let new connections through."""
        self._hang_up()
        self._dead = False
        self._moving.set()

    def _hang_up(self) -> None:
        with self._lock:
            ends, self._ends = self._ends, []
        for end in ends:
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            try:
                far = socket.create_connection(("127.0.0.1", self._target_port), 2.0)
            except OSError:
                near.close()
                continue
            far.settimeout(None)
            for end in (near, far):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            with self._lock:
                self._ends += [near, far]
            for source, sink in ((near, far), (far, near)):
                Thread(target=self._pass_on, args=(source, sink), daemon=True).start()

    def _pass_on(self, source: socket.socket, sink: socket.socket) -> None:
        way: queue.Queue[tuple[float, bytes]] = queue.Queue(_MOST_ON_THE_WAY)
        Thread(target=self._deliver, args=(way, sink), daemon=True).start()
        with suppress(OSError):
            while data := source.recv(_BYTES if self.bytes_per_s is None else 4096):
                if not self._dead:
                    way.put((time.monotonic() + self.delay_s, data))
                if self.bytes_per_s is not None:
                    time.sleep(len(data) / self.bytes_per_s)
                self._moving.wait()
        way.put((0.0, b""))
        for end in (source, sink):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    @staticmethod
    def _deliver(way: queue.Queue[tuple[float, bytes]], sink: socket.socket) -> None:
        while (item := way.get())[1]:
            time.sleep(max(0.0, item[0] - time.monotonic()))
            with suppress(OSError):
                sink.sendall(item[1])
