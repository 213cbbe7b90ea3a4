"""A path of its own for the emergency stop, on the robot's host: a Unix socket of every drive.

No router, no other client, no shared memory and no network have a part in it. A client sends one
`EStop` that engages, or nothing to ask only, and shuts down its sending side; the drive obeys,
goes round once, and answers with its `DriveState`: what its wheels are told from then on. What
cannot be read engages. Nothing is released here.
"""

from __future__ import annotations

import logging
import os
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from heel.schemas import DriveState, EStop, HeelError, MessageError, decode, encode
from heel.services.runtime.places import run_folder

_CLIENT_S = 0.5
"""A client that sends or takes nothing for so long is given up: others wait behind it."""
_ROUND_S = 0.3
"""Longest wait for the drive's loop to go round: fifteen of its rounds."""
_LOOK_S = 1.0
"""Seconds between two looks whether the socket is still where clients look for it; chosen by
hand."""
_BACKLOG = 64
"""Clients that may wait; chosen by hand."""


def _socket_path(folder: Path, robot: str) -> Path:
    return folder / f"drive-{robot}-{os.getpid()}.sock"


class StopSocket:
    """The drive's side: a thread that takes stops. Use as a context manager.

    Args:
        robot: name of the robot in files of this host.
        press: obeys a stop; called from the thread, has to return at once.
        told: what the wheels were told last, and how many rounds the drive's loop has gone.
        log: told once where the socket cannot be had; the drive works without.
    """

    def __init__(
        self, robot: str, press: Callable[[EStop], None],
        told: Callable[[], tuple[DriveState | None, int]], log: logging.Logger,
    ) -> None:  # fmt: skip
        self._robot = robot
        self._press = press
        self._told = told
        self._log = log
        self._listener: socket.socket | None = None
        self._path: Path | None = None
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="stop-socket", daemon=True)

    def __enter__(self) -> Self:
        try:
            self._open()
        except (OSError, HeelError) as error:
            self._log.warning("no stop socket on this host: %s; stops come by Zenoh only", error)
            self._listener = None
            return self
        self._thread.start()
        return self

    def _open(self) -> None:
        path = _socket_path(run_folder(), self._robot)
        path.unlink(missing_ok=True)
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        listener.settimeout(_LOOK_S)
        listener.bind(str(path))
        os.chmod(path, 0o600)
        listener.listen(_BACKLOG)
        self._listener, self._path = listener, path

    def _look_after_path(self) -> None:
        """Listen anew where the folder has gone: with a session, or by a clean-up of `/tmp`."""
        before, gone = self._listener, self._path
        assert before is not None
        assert gone is not None
        with suppress(OSError, HeelError):
            if gone.exists() and gone == _socket_path(run_folder(), self._robot):
                return
            self._open()
            before.close()
            if gone != self._path:
                gone.unlink(missing_ok=True)

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        if self._listener is not None:
            with suppress(OSError):
                self._listener.shutdown(socket.SHUT_RDWR)
            self._listener.close()
            self._thread.join(_CLIENT_S)
        if self._path is not None:
            with suppress(OSError):
                self._path.unlink()

    def _run(self) -> None:
        assert self._listener is not None
        looked_s = time.monotonic()
        while not self._ending.is_set():
            if time.monotonic() - looked_s >= _LOOK_S:
                looked_s = time.monotonic()
                self._look_after_path()
            try:
                client, _ = self._listener.accept()
            except TimeoutError:
                continue
            except OSError:
                if self._ending.wait(0.1):
                    return
                continue
            with client, suppress(OSError):
                self._serve(client)

    def _serve(self, client: socket.socket) -> None:
        client.settimeout(_CLIENT_S)
        received = b""
        while len(received) <= EStop.max_bytes and (part := client.recv(EStop.max_bytes + 1)):
            received += part
        if received:
            self._press(_understood(received))
        client.sendall(encode(state) if (state := self._after_a_round()) else b"")

    def _after_a_round(self) -> DriveState | None:
        """What the wheels are told once the loop has seen the stop; None if it does not go on."""
        _, before = self._told()
        deadline_s = time.monotonic() + _ROUND_S
        while time.monotonic() < deadline_s:
            state, rounds = self._told()
            # The one that runs at the moment may have begun before.
            if rounds >= before + 2:
                return state
            if self._ending.wait(0.002):
                return None
        return None


def _understood(received: bytes) -> EStop:
    with suppress(MessageError):
        message = decode(EStop, received)
        if message.engaged:
            return message
    return EStop(engaged=True, source="a message that cannot be read, by the stop socket")


@dataclass(frozen=True)
class LocalAnswer:
    """What one drive on this host said."""

    pid: int
    state: DriveState | None
    """None if it takes connections and does not answer: it hangs."""


def drives_here(robot: str, press: EStop | None, timeout_s: float) -> list[LocalAnswer]:
    """Stop the robot's drives on this host, or only ask them.

    Args:
        robot: name of the robot in files of this host.
        press: an engagement; None only asks.
        timeout_s: for all of them together.
    """
    try:
        paths = sorted(run_folder().glob(f"drive-{robot}-*.sock"))
    except (OSError, HeelError):
        return []
    deadline_s = time.monotonic() + timeout_s
    calls = []
    for path in paths:
        with suppress(OSError):
            call = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            call.settimeout(timeout_s)
            try:
                call.connect(str(path))
                call.sendall(b"" if press is None else encode(press))
                call.shutdown(socket.SHUT_WR)
            except ConnectionRefusedError:
                # Left behind by a drive that was killed.
                call.close()
                path.unlink()
                continue
            calls.append((int(path.stem.rpartition("-")[2]), call))
    return [LocalAnswer(pid, _answer(call, deadline_s)) for pid, call in calls]


def _answer(call: socket.socket, deadline_s: float) -> DriveState | None:
    received = b""
    with call, suppress(OSError, MessageError):
        while len(received) <= DriveState.max_bytes:
            call.settimeout(max(0.001, deadline_s - time.monotonic()))
            if not (part := call.recv(DriveState.max_bytes + 1)):
                return decode(DriveState, received)
            received += part
    return None
