"""The units of `heel systemd`, run as systemd runs them: started, watched and started again.

Only what the units themselves say is done, so that the configuration that is shipped is the one
that is measured: the command, `WatchdogSec` by the notify socket, `Restart=on-failure` with its
delay, its limit and the exit code that prevents it.
"""

from __future__ import annotations

import os
import shlex
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from heel.services.commands.systemd import Layout, unit_name, units
from heel.services.runtime.process import PARENT_VARIABLE

_LOOK_S = 0.02
"""Longest wait [s] for a sign of life before the process itself is looked at; chosen by hand."""


@dataclass(frozen=True)
class Unit:
    """What a unit says, times in seconds."""

    service: str
    command: tuple[str, ...]
    watchdog_s: float
    restart_s: float
    stop_s: float
    most_starts: int
    within_s: float
    prevented: frozenset[int]

    @classmethod
    def parsed(cls, service: str, text: str) -> Unit:
        """Of a unit's text.

        Raises:
            ValueError: it is no unit that is started again when it fails.
        """
        told = dict(line.split("=", 1) for line in text.splitlines()
                    if "=" in line and not line.startswith("#"))  # fmt: skip
        if (told["Type"], told["Restart"], told["WatchdogSignal"]) != (
            "notify", "on-failure", "SIGKILL",
        ):  # fmt: skip
            raise ValueError(f"{service}: another kind of unit than is known here")
        return cls(
            service, tuple(shlex.split(told["ExecStart"])), float(told["WatchdogSec"]),
            float(told["RestartSec"]), float(told["TimeoutStopSec"]), int(told["StartLimitBurst"]),
            float(told["StartLimitIntervalSec"]),
            frozenset(map(int, told["RestartPreventExitStatus"].split())),
        )  # fmt: skip


class InitSystem:
    """Keeps the units of a robot going; use as a context manager.

    Args:
        services: of the robot, without the router.
        folder: for the logs and the notify sockets.
        environment: what the file `heel.env` would hold, and what a process needs besides.
    """

    def __init__(
        self, services: tuple[str, ...], folder: Path, environment: Mapping[str, str]
    ) -> None:
        layout = Layout((sys.executable, "-P", "-m", "heel"), services, user=True)
        texts = units(layout)
        self._units = [Unit.parsed(name, texts[unit_name(name)]) for name in layout.names]
        self._folder, self._environment = folder, environment
        self._over = threading.Event()
        self._forgiven_s = 0.0
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._threads = [
            threading.Thread(target=self._keep, args=(unit,), daemon=True) for unit in self._units
        ]
        self.starts: dict[str, int] = {unit.service: 0 for unit in self._units}
        """How often each service has been started."""

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        for thread in self._threads:
            thread.join()

    def pid(self, service: str) -> int | None:
        """Process number of a service, None while there is none."""
        process = self._processes.get(service)
        return None if process is None or process.poll() is not None else process.pid

    def forgive(self) -> None:
        """Forget the starts so far: as `systemctl reset-failed`, for faults one after the other."""
        self._forgiven_s = time.monotonic()

    def _keep(self, unit: Unit) -> None:
        address = self._folder / f"{unit.service}.notify"
        starts: deque[float] = deque()
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
            listener.bind(str(address))
            listener.settimeout(_LOOK_S)
            while not self._over.is_set():
                now_s = time.monotonic()
                oldest_s = max(now_s - unit.within_s, self._forgiven_s)
                while starts and starts[0] < oldest_s:
                    starts.popleft()
                if len(starts) >= unit.most_starts:
                    return
                starts.append(now_s)
                code = self._run(unit, address, listener)
                if code == 0 or code in unit.prevented:
                    return
                self._over.wait(unit.restart_s)

    def _run(self, unit: Unit, address: Path, listener: socket.socket) -> int:
        """Run a service once; its exit code."""
        environment = {
            **self._environment, "NOTIFY_SOCKET": str(address), "PYTHONUNBUFFERED": "1",
            "WATCHDOG_USEC": f"{unit.watchdog_s * 1e6:.0f}", PARENT_VARIABLE: str(os.getpid()),
        }  # fmt: skip
        with (self._folder / f"{unit.service}.log").open("ab") as log:
            process = subprocess.Popen(
                unit.command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=environment,
                start_new_session=True,
            )  # fmt: skip
        self._processes[unit.service] = process
        self.starts[unit.service] += 1
        alive_s: float | None = None
        while process.poll() is None:
            if self._over.is_set():
                return self._end(unit, process)
            with suppress(TimeoutError):
                said = listener.recv(4096)
                if said in (b"READY=1", b"WATCHDOG=1"):
                    alive_s = time.monotonic()
            if alive_s is not None and time.monotonic() - alive_s > unit.watchdog_s:
                process.send_signal(signal.SIGKILL)
                process.wait()
        return process.returncode

    def _end(self, unit: Unit, process: subprocess.Popen[bytes]) -> int:
        process.terminate()
        try:
            return process.wait(unit.stop_s)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.wait()
