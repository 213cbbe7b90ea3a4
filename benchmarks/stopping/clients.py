"""Clients that have no part in stopping, and hold it up if anything lets them.

Run as a process: python -m benchmarks.stopping.clients viewer|flood ENDPOINT
"""

from __future__ import annotations

import json
import secrets
import signal
import sys
import time

import zenoh

from heel.schemas import DriveState, EStop, FollowState, MotionCommand, Stamp, Target, encode, keys
from heel.services.runtime.process import die_with_parent


def _session(endpoint: str) -> zenoh.Session:
    config = zenoh.Config()
    for path, value in (
        ("mode", "client"),
        ("connect/endpoints", [endpoint]),
        ("connect/timeout_ms", 60_000),
        ("connect/retry", {"period_init_ms": 100, "period_max_ms": 300}),
        ("scouting/multicast/enabled", False),
        # As on another computer, and as any user has it who may not lock memory.
        ("transport/shared_memory/enabled", False),
    ):
        config.insert_json5(path, json.dumps(value))
    return zenoh.open(config)


def view(endpoint: str) -> None:
    """Receive everything there is, as a viewer or a recorder does."""
    with _session(endpoint) as session:
        session.declare_subscriber("**", lambda sample: None)
        print("up", flush=True)
        # Until it is killed, with its parent at the latest.
        signal.pause()


def flood(endpoint: str) -> None:
    """Say all the time that nothing has to stop, in everybody's name, as fast as it goes."""
    stamp = encode(Stamp(producer="drive/main@00000001", t_sent_ns=0, age_ns=0))
    drive = DriveState(
        seq=1, state="driving", reason="", estop=False, driver="log", linear_mps=1.0,
        angular_radps=0.0,
    )  # fmt: skip
    state = FollowState(
        seq=1, state="following", reason="", estop=False, target=Target(seq=0, mode="none"),
        linear_mps=1.0, angular_radps=0.0,
    )  # fmt: skip
    command = MotionCommand(
        seq=1, linear_mps=1.0, angular_radps=0.0, ttl_s=0.5, state="following", reason=""
    )
    rival = encode(Stamp(producer="follower/rival@00000001", t_sent_ns=0, age_ns=0))
    with _session(endpoint) as session:
        print("up", flush=True)
        while True:
            for name in (secrets.token_hex(8), ""):
                release = EStop(engaged=False, source="flood", id=name, t_ns=time.time_ns())
                _put(session, keys.FOLLOW_ESTOP, encode(release), release.encoding())
            _put(session, keys.ROBOT_DRIVE, encode(drive), drive.encoding(), stamp)
            _put(session, keys.FOLLOW_STATE, encode(state), state.encoding())
            _put(session, keys.FOLLOW_COMMAND, encode(command), command.encoding(), rival)


def _put(
    session: zenoh.Session, key: str, payload: bytes, encoding: str, stamp: bytes | None = None
) -> None:
    session.put(
        key, payload, encoding=encoding, attachment=stamp, express=True,
        priority=zenoh.Priority.REAL_TIME, congestion_control=zenoh.CongestionControl.BLOCK,
    )  # fmt: skip


if __name__ == "__main__":
    die_with_parent()
    {"viewer": view, "flood": flood}[sys.argv[1]](sys.argv[2])
