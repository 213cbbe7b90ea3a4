"""The emergency stop, pressed while everything else goes wrong as well."""

from __future__ import annotations

import os
import random
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from benchmarks.stopping.fault import Fault
from benchmarks.stopping.rig import Rig
from heel.schemas import HeelError, keys

ESTOP_MS = 50.0
_COMMAND_MS = 2000.0
_SHARED_MEMORY = Path("/dev/shm")
_MOST_FILLED_BYTES = 1 << 30
"""A larger /dev/shm is the machine's own, and not for a benchmark to fill."""
_RESTARTED = ("router", "drive", "follower")
_SETTLE_S = 4.0
_moments = random.Random(2)


def all_stops() -> list[Fault]:
    """Every row, pressed as any program presses it: one message, sent once."""
    rows = [
        Fault("emergency stop", ESTOP_MS, Rig.press, Rig.release),
        _beside("viewer frozen", _frozen, _viewer_back),
        _beside("viewer gone", _gone, _viewer_back),
        _beside("viewer slow", _slow, _viewer_back),
        # Among ten thousand messages a second one may be dropped: pressed as `heel stop` does.
        _beside("flood of releases", _flood, lambda rig: rig.end_client("flood"), Rig.press_here),
        replace(
            _beside("flood, pressed elsewhere", _flood, lambda rig: rig.end_client("flood"),
                    Rig.press_until_it_stands),
            bound_ms=_COMMAND_MS,
        ),
        _beside("/dev/shm full", _fill, lambda rig: _filler().unlink(missing_ok=True)),
        Fault("emergency stop: unreadable", ESTOP_MS, _unreadable, Rig.release),
        Fault("emergency stop: router killed", ESTOP_MS, _without_router, _router_back),
        Fault("emergency stop: then all restart", ESTOP_MS, Rig.press, Rig.release,
              afterwards=_rolling_restart),
        Fault("`heel stop` says what is true", _COMMAND_MS, _command, Rig.release,
              in_ms=lambda rig, fault_ns: rig.command_ms),
    ]  # fmt: skip
    return [replace(row, perception=False) for row in rows]


def _beside(
    trouble: str, make: Callable[[Rig], None], undo: Callable[[Rig], None],
    press: Callable[[Rig], None] = Rig.press,
) -> Fault:  # fmt: skip
    """Trouble first, and the stop some time within it."""

    def inject(rig: Rig) -> int:
        make(rig)
        time.sleep(_moments.uniform(0.2, 2.2))
        pressed_ns = time.monotonic_ns()
        press(rig)
        return pressed_ns

    def lift(rig: Rig) -> None:
        undo(rig)
        rig.release()

    return Fault(f"emergency stop: {trouble}", ESTOP_MS, inject, lift)


def _frozen(rig: Rig) -> None:
    # Not behind a relay, which takes what the viewer does not.
    rig.start_client("viewer", "viewer")
    rig.signal("viewer", signal.SIGSTOP)


def _gone(rig: Rig) -> None:
    rig.start_client("viewer", "viewer", relayed=True)
    rig.relays["viewer"].stall()


def _slow(rig: Rig) -> None:
    rig.start_client("viewer", "viewer", relayed=True)
    rig.relays["viewer"].bytes_per_s = 50_000.0


def _viewer_back(rig: Rig) -> None:
    rig.relays["viewer"].bytes_per_s = None
    rig.relays["viewer"].mend()
    rig.end_client("viewer")


def _flood(rig: Rig) -> None:
    rig.start_client("flood", "flood")


def _filler() -> Path:
    return _SHARED_MEMORY / "heel-benchmark-filler"


def _fill(rig: Rig) -> None:
    found = os.statvfs(_SHARED_MEMORY)
    if found.f_blocks * found.f_frsize > _MOST_FILLED_BYTES:
        raise HeelError(
            "this row fills /dev/shm: give the benchmark one of its own, `unshare -m sh -c "
            "'mount -t tmpfs -o size=256m tmpfs /dev/shm; exec python -m benchmarks...'`"
        )
    with _filler().open("wb") as filler:
        try:
            while True:
                filler.write(bytes(1 << 16))
                filler.flush()
        except OSError:
            return


def _unreadable(rig: Rig) -> None:
    rig.session.put(keys.FOLLOW_ESTOP, b"stop!", encoding="text/plain", express=True)


def _without_router(rig: Rig) -> int:
    rig.signal("router", signal.SIGKILL)
    time.sleep(_moments.uniform(0.0, 0.3))
    pressed_ns = time.monotonic_ns()
    rig.press_here()
    return pressed_ns


def _router_back(rig: Rig) -> None:
    rig.restart("router")
    rig.release()


def _rolling_restart(rig: Rig) -> None:
    """Router, drive and follower, in any order and as close together as it comes."""
    names = list(_RESTARTED)
    _moments.shuffle(names)
    for name in names:
        rig.signal(name, signal.SIGTERM)
        if _moments.random() < 0.5:
            time.sleep(_moments.uniform(0.0, 1.0))
    for name in names:
        rig.restart(name)
        time.sleep(_moments.uniform(0.0, 0.5))
    rig.await_alive("drive", "follower")
    rig.choose_nearest()
    time.sleep(_SETTLE_S)


def _command(rig: Rig) -> None:
    started_s = time.monotonic()
    code = rig.heel("stop")
    rig.command_ms = (time.monotonic() - started_s) * 1e3 if code == 0 else float("inf")
