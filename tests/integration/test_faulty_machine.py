"""Real services on a machine at fault: no room in memory or on disk, and a clock that jumps.

The faults lie in namespaces of the services' own, and in what they are told the time is.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
import zenoh

from heel.schemas import DriveState, EStop, Stamp, Tracks, decode, encode, keys
from tests.support import network
from tests.support.processes import Running, finished, running
from tests.support.service_faults import Put, broken, good_messages

pytestmark = [pytest.mark.slow, pytest.mark.timeout(120)]

_IN_NAMESPACE = """
import os, sys
own = ["-m"] if os.geteuid() == 0 else ["-rm"]
os.execvp("unshare", ["unshare", *own, "sh", "-c", sys.argv[1]])
"""
_JUMPING = """
import runpy, sys, time
jump_s, module = float(sys.argv[1]), sys.argv[2]
told, told_ns, jumps_at_s = time.time, time.time_ns, time.monotonic() + 3.0
ahead_s = lambda: jump_s if time.monotonic() > jumps_at_s else 0.0
time.time = lambda: told() + ahead_s()
time.time_ns = lambda: told_ns() + round(ahead_s() * 1e9)
sys.argv = sys.argv[2:]
runpy.run_module(module, run_name="__main__", alter_sys=True)
"""
"""A service whose wall clock jumps three seconds after its start."""


@contextmanager
def mounted(folder: str, size: str, service: str, endpoint: str, *flags: str) -> Iterator[Running]:
    """A service to which a folder is a disk of this size, full to the last byte with `fill`."""
    code, _, _ = finished("-c", _IN_NAMESPACE, f"mount -t tmpfs tmpfs {folder}")
    if code:
        pytest.skip("no mount namespaces here")
    words = [sys.executable, "-P", "-m", f"heel.services.{service}", "--connect", endpoint, *flags]
    script = f"mount -t tmpfs -o mode=700,size={size} tmpfs {folder} && exec {' '.join(words)}"
    with running("-c", _IN_NAMESPACE, script, HEEL_RUNTIME_DIR=folder) as process:
        network.wait_until(lambda: " is up" in process.stderr(), f"{service} up", 30.0)
        yield process


def fill(process: Running, folder: str) -> None:
    """Use up what is left of the service's disk."""
    inside = Path(f"/proc/{process.process.pid}/root{folder}/fill")
    descriptor = os.open(inside, os.O_WRONLY | os.O_CREAT)
    try:
        with suppress(OSError):
            while True:
                os.write(descriptor, bytes(4096))
    finally:
        os.close(descriptor)


def send(session: zenoh.Session, put: Put) -> None:
    session.put(put.key, put.payload, encoding=put.encoding, attachment=put.attachment)


def answered(session: zenoh.Session, message: str, answer: str, seqs: range) -> list[zenoh.Sample]:
    """What a service answers to one message after the other."""
    with network.collected(session, answer) as answers:
        found = []
        for seq in seqs:
            send(session, good_messages(seq)[message])
            found.append(answers.get(timeout=network.DEADLINE_S))
        return found


def test_a_full_shared_memory_costs_shared_memory_and_no_frame() -> None:
    with network.router() as endpoint, network.client(endpoint) as session:
        with mounted("/dev/shm", "64m", "detector", endpoint, "--camera", "detector") as detector:
            answered(session, "detector image", keys.blobs("detector"), range(1, 4))
            fill(detector, "/dev/shm")
            answered(session, "detector image", keys.blobs("detector"), range(4, 30))
            assert detector.alive
            network.wait_until(
                lambda: "/dev/shm is 100% full" in detector.stderr(), "a word about it"
            )


def test_a_service_begins_where_shared_memory_is_full_already() -> None:
    with network.router() as endpoint, network.client(endpoint) as session:
        with mounted("/dev/shm", "64k", "detector", endpoint, "--camera", "detector") as detector:
            answered(session, "detector image", keys.blobs("detector"), range(1, 10))
            assert "no shared memory: " in detector.stderr()


def test_a_full_disk_costs_what_would_be_kept_and_no_frame(tmp_path: Path) -> None:
    folder = str(tmp_path)
    with network.router() as endpoint, network.client(endpoint) as session:
        with mounted(folder, "64k", "tracker", endpoint, "--camera", "tracker") as tracker:
            fill(tracker, folder)
            for first in (1, 20):
                answered(session, "tracker blobs", keys.tracks("tracker"), range(first, first + 9))
                time.sleep(1.2)
            answered(session, "tracker blobs", keys.tracks("tracker"), range(40, 49))
            assert tracker.stderr().count("the state cannot be written") == 1


def test_a_full_disk_holds_up_no_emergency_stop(tmp_path: Path) -> None:
    folder = str(tmp_path)
    with network.router() as endpoint, network.client(endpoint) as session:
        with mounted(folder, "64k", "drive", endpoint) as drive:
            fill(drive, folder)
            stop = EStop(engaged=True, source="test", id="ab", t_ns=time.time_ns())
            with network.collected(session, keys.ROBOT_DRIVE) as states:
                send(session, Put(keys.FOLLOW_ESTOP, encode(stop), stop.encoding()))

                def stopped() -> bool:
                    sample = states.get(timeout=network.DEADLINE_S)
                    return decode(DriveState, sample.payload.to_bytes()).estop

                network.wait_until(stopped, "the stop")
            network.wait_until(
                lambda: "the emergency stop cannot be written" in drive.stderr(), "a word about it"
            )
            assert drive.alive


@pytest.mark.parametrize("jump_s", [3600.0, -3600.0])
def test_a_wall_clock_that_jumps_makes_no_frame_older_or_newer(jump_s: float) -> None:
    with network.router() as endpoint, network.client(endpoint) as session:
        flags = ("heel.services.tracker", "--camera", "tracker", "--connect", endpoint)
        with running("-c", _JUMPING, str(jump_s), *flags) as tracker:
            network.wait_until(lambda: " is up" in tracker.stderr(), "the tracker", 30.0)
            key, seq, jumped = keys.tracks("tracker"), 0, False
            while not jumped:
                seq += 1
                assert seq < 2000, "its clock never jumped"
                (sample,) = answered(session, "tracker blobs", key, range(seq, seq + 1))
                assert sample.attachment is not None
                stamp = decode(Stamp, sample.attachment.to_bytes())
                assert decode(Tracks, sample.payload.to_bytes()).seq == seq
                assert stamp.age_ns < 2e9
                jumped = abs(stamp.t_sent_ns - time.time_ns()) > 1000e9
                time.sleep(0.01)
            send(session, broken(good_messages(seq + 1)["tracker blobs"], "blobs", "malformed"))
            answered(session, "tracker blobs", key, range(seq + 2, seq + 20))
            assert tracker.alive
