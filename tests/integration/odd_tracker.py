"""A tiny program that stands in for a tracker and misbehaves in one way.

Run as a process: python -m tests.integration.odd_tracker ENDPOINT FAULT START
It shows one person who walks on the spot, 25 times a second. From SIGUSR1 to SIGUSR2 it is at
fault.
"""

from __future__ import annotations

import itertools
import os
import signal
import sys
import threading
import time

from heel.schemas import Stamp, encode, keys
from heel.services.runtime.process import die_with_parent
from tests.support.network import client
from tests.unit.follower.people import person, tracks

PERIOD_S = 0.04
LATE_NS = 500_000_000
JUMP_NS = 3600 * 10**9
_EVERY = 25
"""Of a slow one so many pictures one is sent."""
_FRAMES = 10_000
"""More than a tracker lives to see."""


def main(endpoint: str, fault: str, start: str) -> None:
    """Send until the process is ended."""
    die_with_parent()
    at_fault = threading.Event()
    signal.signal(signal.SIGUSR1, lambda *_: at_fault.set())
    signal.signal(signal.SIGUSR2, lambda *_: at_fault.clear())
    with client(endpoint) as session:
        print("up", flush=True)
        # Of one camera: frames that were there before are refused.
        for seq in itertools.count(_FRAMES * int(start, 16)):
            time.sleep(PERIOD_S)
            told = fault if at_fault.is_set() else ""
            if told == "crashing":
                os._exit(1)
            if told == "frozen":
                at_fault.clear()
                os.kill(os.getpid(), signal.SIGSTOP)
            if told == "silent" or (told == "slow" and seq % _EVERY):
                continue
            shift_px = 5.0 * (seq % 4)
            seen = person(1, height=60.0)
            left, top, right, bottom = seen.box_xyxy
            box = (left + shift_px, top, right + shift_px, bottom)
            stamp = Stamp(
                producer=f"tracker/main@{start}",
                t_sent_ns=time.time_ns() + (JUMP_NS if told == "clock jump" else 0),
                age_ns=LATE_NS if told == "late" else 0,
            )
            message = tracks(seen.model_copy(update={"box_xyxy": box}), seq=seq)
            session.put(
                keys.tracks("front"), encode(message), encoding=message.encoding(),
                attachment=encode(stamp),
            )  # fmt: skip


if __name__ == "__main__":
    main(*sys.argv[1:])
