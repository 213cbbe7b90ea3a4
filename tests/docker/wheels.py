"""Runs inside a container: a line for every word of the drive and for every true speed.

`drive TIME PRODUCER STOPPED SPEED` and `truth TIME SPEED`, times by the host's monotonic clock.
"""

from __future__ import annotations

import queue
import sys
import time

import zenoh

from heel.schemas import DriveState, SimTruth, Stamp, decode, keys

config = zenoh.Config.from_json5(
    '{mode: "client", connect: {endpoints: ["tcp/router:7447"], timeout_ms: 10000, '
    "exit_on_failure: true}, scouting: {multicast: {enabled: false}}}"
)
samples: queue.Queue[tuple[float, zenoh.Sample]] = queue.Queue()
until_s = time.monotonic() + float(sys.argv[1])
with zenoh.open(config) as session:
    subscribers = [
        session.declare_subscriber(key, lambda sample: samples.put((time.monotonic(), sample)))
        for key in (keys.ROBOT_DRIVE, keys.SIM_TRUTH)
    ]
    print("listening", flush=True)
    while time.monotonic() < until_s:
        try:
            at_s, sample = samples.get(timeout=0.1)
        except queue.Empty:
            continue
        payload, encoding = sample.payload.to_bytes(), str(sample.encoding)
        if encoding == DriveState.encoding():
            state = decode(DriveState, payload, encoding)
            producer = decode(Stamp, sample.attachment.to_bytes()).producer
            print("drive", at_s, producer, int(state.estop), state.linear_mps, flush=True)
        elif encoding == SimTruth.encoding():
            print("truth", at_s, decode(SimTruth, payload, encoding).linear_mps, flush=True)
    for subscriber in subscribers:
        subscriber.undeclare()
