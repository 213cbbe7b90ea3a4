"""The whole stack as real processes, each behind a link of its own, and a record of its wheels."""

from __future__ import annotations

import logging
import math
import os
import secrets
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Self

import zenoh

from benchmarks.common import NAMED_NETWORKS, REPOSITORY, wait_for
from benchmarks.stopping.camera import FaultyCamera
from benchmarks.stopping.ranges import RangeSensor
from benchmarks.stopping.relay import Relay
from benchmarks.stopping.stand_in import StandIn
from heel.schemas import (
    EStop,
    FollowState,
    HeelError,
    Message,
    MotionCommand,
    Ranges,
    Stamp,
    TargetRequest,
    decode,
    encode,
    keys,
)
from heel.services.commands.robot_line import REPEAT_S
from heel.services.run.children import start_python
from heel.services.runtime.places import VARIABLE, robot_name
from heel.services.runtime.process import PARENT_VARIABLE
from heel.services.runtime.session import open_session
from heel.services.runtime.settings import ZenohSettings
from heel.services.runtime.stop_socket import drives_here

CHAIN = ("capture", "detector", "tracker", "follower", "drive")
_ROBOT = ("follower", "drive")
_SENSOR = "sonar/main@00000001"
_READY_S = 60.0
_STEADY_S = 0.3
"""A robot that has moved for so long without a pause counts as driving."""
_CHOOSE_EVERY_S = 1.0
_DOUBT_S = 6.0
"""A tracker that is unsure of the person for so long after a fault is started anew."""


class Rig:
    """Router, capture, detector, tracker, follower and drive, following somebody.

    Use as a context manager. Every service reaches the router by a relay that can be cut.

    Args:
        folder: for logs and the record of the wheels.
        perception: whether a real camera, detector and tracker find the person; otherwise
            something stands in for them.
    """

    def __init__(self, folder: Path, perception: bool = True) -> None:
        self._perception = perception
        self._folder = folder
        self._resources = ExitStack()
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        folder.mkdir(parents=True, exist_ok=True)
        self._run_folder = folder.absolute() / "run"
        self._run_folder.mkdir(mode=0o700, exist_ok=True)
        self._record = folder / "wheels.txt"
        self._record.write_text("")
        self._router_port = _free_port()
        self._camera = FaultyCamera() if perception else None
        self.ranges = RangeSensor(self._publish_ranges, self._publish_spoilt_ranges)
        self.relays = {name: Relay(self._router_port) for name in (*CHAIN, "viewer")}
        self.engagement = ""
        """Of the newest emergency stop pressed here."""
        self.command_ms = math.inf
        """How long the last `heel stop` took; infinite if it did not say that the robot stands."""
        self.newest_command: tuple[MotionCommand, str] | None = None
        """The follower's newest command and its producer."""

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            stack.callback(self._end_all)
            if self._camera is not None:
                stack.enter_context(self._camera)
            for relay in self.relays.values():
                stack.enter_context(relay)
            for name in ("router", *(CHAIN if self._perception else _ROBOT)):
                self.start(name)
            connect = ZenohSettings(
                connect=(f"tcp/127.0.0.1:{self._router_port}",), connect_timeout_s=_READY_S
            )

            def opened() -> zenoh.Session:
                session = open_session(connect, logging.getLogger("rig"), _pause)
                assert session is not None
                return session

            self.session = stack.enter_context(opened())
            if not self._perception:
                stack.enter_context(StandIn(opened))
            self.session.declare_subscriber(keys.FOLLOW_COMMAND, self._note_command)
            stack.enter_context(self.ranges)
            self._resources = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._resources.close()

    @property
    def camera(self) -> FaultyCamera:
        """The camera of a rig that has one."""
        assert self._camera is not None
        return self._camera

    def start(self, name: str, *more: str) -> None:
        """Start one process, with flags beyond its usual ones."""
        flags = {
            "router": ("--listen", f"tcp/127.0.0.1:{self._router_port}"),
            "capture": () if self._camera is None else (self._camera.address,),
            # To turn after somebody who went away, and to look for them, is motion on purpose.
            "follower": ("--target", "nearest", "--hold-s", "0", "--search-s", "0"),
            "drive": ("--driver", "record", "--driver-options", str(self._record)),
        }.get(name, ())
        flags = (*flags, *more)
        if name in CHAIN:
            endpoint = f"tcp/127.0.0.1:{self.relays[name].port}"
            flags = (*flags, "--connect", endpoint, "--connect-timeout-s", f"{_READY_S:g}")
        self._start(name, "heel", name, *flags)

    def start_client(self, name: str, kind: str, relayed: bool = False) -> None:
        """Start a client that has no part in stopping, unless it runs; it is up on return."""
        if name in self._processes and self._processes[name].poll() is None:
            return
        port = self.relays[name].port if relayed else self._router_port
        log = self._folder / f"{name}.log"
        log.write_bytes(b"")
        self._start(name, "benchmarks.stopping.clients", kind, f"tcp/127.0.0.1:{port}")
        process = self._processes[name]
        wait_for(
            lambda: b"up" in log.read_bytes() or process.poll() is not None, _READY_S,
            f"{name} does not start (see {log})",
        )  # fmt: skip
        if process.poll() is not None:
            raise HeelError(f"{name} ended with code {process.returncode}: see {log}")

    def end_client(self, name: str) -> None:
        """End one, if it runs."""
        if (process := self._processes.pop(name, None)) is not None:
            process.kill()
            process.wait(5.0)

    def heel(self, *arguments: str) -> int:
        """Run a command of `heel` at this robot; its exit code."""
        # By the drive's own endpoint, by which a drive on this machine is known.
        endpoint = f"tcp/127.0.0.1:{self.relays['drive'].port}"
        with (self._folder / "heel.log").open("ab") as log:
            return subprocess.call(
                [sys.executable, "-m", "heel", *arguments, "--connect", endpoint],
                cwd=REPOSITORY, env=self._environment(), stdin=subprocess.DEVNULL, stdout=log,
                stderr=log, timeout=_READY_S,
            )  # fmt: skip

    def press_here(self) -> None:
        """Press the emergency stop by the drive's own socket."""
        stop = self._new_stop()
        with _run_folder(self._run_folder):
            drives_here(self._robot_name(), stop, 1.0)

    def press(self) -> None:
        """Press the emergency stop as any program does: one message, sent once."""
        self.publish(keys.FOLLOW_ESTOP, self._new_stop())

    def press_until_it_stands(self) -> None:
        """Press it as `heel stop` does on another machine: the same message again and again.

        Raises:
            HeelError: the wheels go on turning.
        """
        stop = self._new_stop()
        for _ in range(round(_READY_S / REPEAT_S)):
            self.publish(keys.FOLLOW_ESTOP, stop)
            time.sleep(REPEAT_S)
            if self.stands_since_ns() is not None:
                return
        raise HeelError(f"the emergency stop was not heard within {_READY_S:g} s")

    def release(self) -> None:
        """Release it, and see to it that everybody has heard it.

        Raises:
            HeelError: somebody goes on holding it.
        """

        def released() -> bool:
            held = self._held()
            for one in held:
                release = EStop(engaged=False, source="benchmark", id=one.id, t_ns=one.t_ns)
                self.publish(keys.FOLLOW_ESTOP, release)
            return not held and self._drive_is_free() and self._follower_is_free()

        wait_for(released, _READY_S, f"the emergency stop cannot be released (see {self._folder})")

    def _drive_is_free(self) -> bool:
        with _run_folder(self._run_folder):
            answers = drives_here(self._robot_name(), None, 1.0)
        return bool(answers) and all(one.state and not one.state.estop for one in answers)

    def _follower_is_free(self) -> bool:
        for reply in self.session.get(keys.FOLLOW_STATE, timeout=1.0):
            if reply.ok is not None:
                return not decode(FollowState, reply.ok.payload.to_bytes()).estop
        return False

    def _robot_name(self) -> str:
        return robot_name(ZenohSettings(connect=(f"tcp/127.0.0.1:{self.relays['drive'].port}",)))

    def _held(self) -> list[EStop]:
        held = []
        for reply in self.session.get(keys.FOLLOW_ESTOP, timeout=1.0):
            if reply.ok is not None:
                estop = decode(EStop, reply.ok.payload.to_bytes())
                held += [estop] if estop.engaged else []
        return held

    def _new_stop(self) -> EStop:
        self.engagement = secrets.token_hex(8)
        return EStop(
            engaged=True, source="benchmark", id=self.engagement, t_ns=time.time_ns()
        )  # fmt: skip

    def _environment(self) -> dict[str, str]:
        kept = {key: value for key, value in os.environ.items() if not key.startswith("HEEL_")}
        kept |= NAMED_NETWORKS
        return kept | {
            "PYTHONPATH": str(REPOSITORY), PARENT_VARIABLE: str(os.getpid()),
            VARIABLE: str(self._run_folder),
        }  # fmt: skip

    def _start(self, name: str, module: str, *words: str) -> None:
        with (self._folder / f"{name}.log").open("ab") as log:
            self._processes[name] = start_python(("-m", module, *words), log, self._environment())

    def start_viewer(self) -> None:
        """Start the page, on any free port."""
        self.start("web", "--port", "0", "--connect", self.endpoint, "--connect-timeout-s", "60")

    @property
    def endpoint(self) -> str:
        """The router's own, past every relay."""
        return f"tcp/127.0.0.1:{self._router_port}"

    def pids(self) -> dict[str, int]:
        """Process number of every process."""
        return {name: process.pid for name, process in self._processes.items()}

    def ended(self) -> list[str]:
        """Processes that are not there any more."""
        return [name for name, process in self._processes.items() if process.poll() is not None]

    def logs(self) -> dict[str, str]:
        """What each process has written so far, by its name."""
        return {log.stem: log.read_text(errors="replace") for log in self._folder.glob("*.log")}

    def log_bytes(self) -> int:
        """What all processes have written so far."""
        return sum(log.stat().st_size for log in self._folder.glob("*.log"))

    def signal(self, name: str, number: signal.Signals) -> None:
        """Send a signal to one process."""
        self._processes[name].send_signal(number)

    def restart(self, name: str) -> None:
        """Start a process anew that has ended or is about to."""
        self._processes[name].wait(5.0)
        self.start(name)

    def publish(self, key: str, message: Message) -> None:
        """Send a message without a stamp."""
        self.session.put(
            key, encode(message), encoding=message.encoding(), express=True,
            priority=zenoh.Priority.REAL_TIME,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )  # fmt: skip

    def wheels(self) -> list[tuple[int, float, float]]:
        """Every change so far: monotonic ns, m/s, rad/s."""
        rows = [line.split() for line in self._record.read_text(encoding="ascii").splitlines()]
        return [(int(row[0]), float(row[1]), float(row[2])) for row in rows if len(row) == 3]

    def stands_since_ns(self) -> int | None:
        """When the wheels were told to stand; None while they turn."""
        rows = self.wheels()
        if not rows:
            return 0
        time_ns, linear_mps, angular_radps = rows[-1]
        if not (math.isfinite(linear_mps) and math.isfinite(angular_radps)):
            raise HeelError(f"the wheels were told {rows[-1]}: no number may come so far")
        return None if linear_mps or angular_radps else time_ns

    def await_driving(self) -> None:
        """Wait until the robot drives steadily, choosing the person again where that is needed.

        Raises:
            HeelError: it does not within a minute.
        """
        started_s = time.monotonic()
        deadline_s, choose_s = started_s + _READY_S, started_s + _CHOOSE_EVERY_S
        doubt_s, turning_since_s = started_s + _DOUBT_S, math.inf
        while time.monotonic() < deadline_s:
            now_s = time.monotonic()
            if self.stands_since_ns() is not None:
                turning_since_s = math.inf
                if now_s >= choose_s:
                    self.choose_nearest()
                    choose_s = now_s + _CHOOSE_EVERY_S
                if now_s >= doubt_s and self._perception:
                    self.signal("tracker", signal.SIGKILL)
                    self.restart("tracker")
                    doubt_s = now_s + _DOUBT_S
            elif (turning_since_s := min(turning_since_s, now_s)) <= now_s - _STEADY_S:
                return
            time.sleep(0.02)
        raise HeelError(f"the robot does not drive within {_READY_S:g} s: see {self._folder}")

    def _publish_ranges(self, ranges: Ranges) -> None:
        stamp = Stamp(producer=_SENSOR, t_sent_ns=time.time_ns(), age_ns=0)
        self.session.put(
            keys.ROBOT_RANGE, encode(ranges), encoding=ranges.encoding(), express=True,
            attachment=encode(stamp), congestion_control=zenoh.CongestionControl.DROP,
        )  # fmt: skip

    def _publish_spoilt_ranges(self, ranges: Ranges) -> None:
        stamp = Stamp(producer=_SENSOR, t_sent_ns=time.time_ns(), age_ns=0)
        self.session.put(
            keys.ROBOT_RANGE, encode(ranges)[:-9], encoding=ranges.encoding(), express=True,
            attachment=encode(stamp), congestion_control=zenoh.CongestionControl.DROP,
        )  # fmt: skip

    def await_alive(self, *services: str) -> None:
        """Wait until these services say that they are there.

        Raises:
            HeelError: one does not within a minute.
        """

        def there() -> bool:
            replies = self.session.liveliness().get(keys.ALL_ALIVE, timeout=0.5)
            names = {str(one.ok.key_expr).split("/")[1] for one in replies if one.ok is not None}
            return names >= set(services)

        wait_for(there, _READY_S, f"{' and '.join(services)} do not come back (see {self._folder})")

    def choose_nearest(self) -> None:
        """Let the follower follow whoever is nearest."""
        request = encode(TargetRequest(mode="nearest"))
        for _ in self.session.get(keys.FOLLOW_TARGET, payload=request, timeout=0.5):
            pass

    def _note_command(self, sample: zenoh.Sample) -> None:
        if sample.attachment is None or str(sample.encoding) != MotionCommand.encoding():
            return
        try:
            command = decode(MotionCommand, sample.payload.to_bytes())
            stamp = decode(Stamp, sample.attachment.to_bytes())
        except HeelError:
            return  # a command that the benchmark itself spoilt
        self.newest_command = command, stamp.producer

    def _end_all(self) -> None:
        for process in self._processes.values():
            process.kill()
        for process in self._processes.values():
            process.wait(5.0)


@contextmanager
def _run_folder(folder: Path) -> Iterator[None]:
    """This process as one of the robot's."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = str(folder)
    try:
        yield
    finally:
        os.environ.pop(VARIABLE)
        if before is not None:
            os.environ[VARIABLE] = before


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def _pause(seconds: float) -> bool:
    time.sleep(seconds)
    return False
