"""Everything that can go wrong with a driving robot, and within what time it then has to stand."""

from __future__ import annotations

import math
import signal
import threading
import time

import msgpack
import zenoh

from benchmarks.stopping.camera import STALL_S, View
from benchmarks.stopping.fault import Fault
from benchmarks.stopping.rig import Rig
from benchmarks.stopping.stops import ESTOP_MS, all_stops
from heel.schemas import MotionCommand, Stamp, encode, keys
from heel.services.drive.settings import DriveSettings

WATCHDOG_MS = DriveSettings().ttl_s * 1e3 + 50.0
"""Commands stop: the drive's own watchdog."""
_HANG_S = 1.0
"""Twice `ttl_s`: a drive that was given no turn for longer than that counts as hung."""
_SILENT_S = 0.05
"""For the last commands before the follower's silence to be on their way; chosen by hand."""
INPUT_MS = 300.0
"""What the commands rest on is lost, stale or frozen."""


def all_faults() -> list[Fault]:
    """Every row, in the order of the data's way from the camera to the wheels."""
    return [
        _view("camera frozen", "frozen"),
        _view("camera black", "black"),
        _view("camera silent", "silent"),
        _view("person gone", "nobody"),
        _stalled_camera(),
        _silent_ranges(),
        _unreadable_ranges(),
        *(fault for name in ("capture", "detector", "tracker") for fault in _of(name, INPUT_MS)),
        _far("detector"),
        *_of("follower", WATCHDOG_MS),
        _killed("router", WATCHDOG_MS),
        _hung("router", WATCHDOG_MS),
        _cut_off("drive", WATCHDOG_MS),
        _nan_commands(),
        Fault("drive told to end", ESTOP_MS, lambda rig: rig.signal("drive", signal.SIGTERM),
              lambda rig: rig.restart("drive")),
        _drive_after_hang(),
        *all_stops(),
    ]  # fmt: skip


def _of(service: str, bound_ms: float) -> tuple[Fault, Fault, Fault]:
    return _killed(service, bound_ms), _hung(service, bound_ms), _cut_off(service, bound_ms)


def _killed(service: str, bound_ms: float) -> Fault:
    return Fault(
        f"{service} killed", bound_ms,
        lambda rig: rig.signal(service, signal.SIGKILL), lambda rig: rig.restart(service),
    )  # fmt: skip


def _hung(service: str, bound_ms: float) -> Fault:
    return Fault(
        f"{service} hung", bound_ms,
        lambda rig: rig.signal(service, signal.SIGSTOP),
        lambda rig: rig.signal(service, signal.SIGCONT),
    )  # fmt: skip


def _cut_off(service: str, bound_ms: float) -> Fault:
    return Fault(
        f"{service} cut off", bound_ms,
        lambda rig: rig.relays[service].cut(), lambda rig: rig.relays[service].mend(),
    )  # fmt: skip


def _view(name: str, view: View) -> Fault:
    def show(rig: Rig, what: View) -> None:
        rig.camera.view = what

    return Fault(name, INPUT_MS, lambda rig: show(rig, view), lambda rig: show(rig, "person"))


def _silent_ranges() -> Fault:
    def silence(rig: Rig, silent: bool) -> None:
        rig.ranges.silent = silent

    return Fault(
        "ranges silent", INPUT_MS, lambda rig: silence(rig, True), lambda rig: silence(rig, False)
    )


def _stalled_camera() -> Fault:
    """A link that stalls: what waited comes at once, and nothing after it; it is old by then."""

    def show(rig: Rig, view: View) -> None:
        rig.camera.view = view

    return Fault(
        "camera stalled for 2 s", INPUT_MS, lambda rig: show(rig, "stalled"),
        lambda rig: show(rig, "person"), watch_s=STALL_S + 1.0,
    )  # fmt: skip


def _unreadable_ranges() -> Fault:
    def spoil(rig: Rig, spoilt: bool) -> None:
        rig.ranges.spoilt = spoilt

    return Fault(
        "ranges unreadable", INPUT_MS, lambda rig: spoil(rig, True), lambda rig: spoil(rig, False)
    )


def _far(service: str) -> Fault:
    """Its link takes 0.4 s each way: results go on to come, each of a frame 0.8 s old."""

    def delay(rig: Rig, delay_s: float) -> None:
        rig.relays[service].delay_s = delay_s

    return Fault(
        f"{service} 0.4 s away", INPUT_MS, lambda rig: delay(rig, 0.4),
        lambda rig: delay(rig, 0.0), watch_s=1.5,
    )  # fmt: skip


def _drive_after_hang() -> Fault:
    """The drive hangs, the follower falls silent, the drive goes on: to what waited for it."""

    def inject(rig: Rig) -> int:
        rig.signal("drive", signal.SIGSTOP)
        time.sleep(_HANG_S)
        rig.signal("follower", signal.SIGSTOP)
        time.sleep(_SILENT_S)
        thawed_ns = time.monotonic_ns()
        rig.signal("drive", signal.SIGCONT)
        return thawed_ns

    return Fault("drive after a hang", ESTOP_MS, inject,
                 lambda rig: rig.signal("follower", signal.SIGCONT))  # fmt: skip


def _nan_commands() -> Fault:
    """The follower hangs, and in its name comes NaN instead, 50 times a second."""
    ending = threading.Event()

    def send(rig: Rig) -> None:
        assert rig.newest_command is not None
        command, producer = rig.newest_command
        stamp = encode(Stamp(producer=producer, t_sent_ns=time.time_ns(), age_ns=0))
        for seq in range(command.seq + 1, command.seq + 10_000):
            spoilt = command.model_dump() | {"seq": seq, "linear_mps": math.nan}
            rig.session.put(
                keys.FOLLOW_COMMAND, msgpack.packb(spoilt), encoding=MotionCommand.encoding(),
                attachment=stamp, express=True, priority=zenoh.Priority.REAL_TIME,
            )  # fmt: skip
            if ending.wait(0.02):
                return

    def inject(rig: Rig) -> None:
        rig.signal("follower", signal.SIGSTOP)
        ending.clear()
        threading.Thread(target=send, args=(rig,), daemon=True).start()

    def lift(rig: Rig) -> None:
        ending.set()
        rig.signal("follower", signal.SIGCONT)

    return Fault("NaN instead of commands", WATCHDOG_MS, inject, lift)
