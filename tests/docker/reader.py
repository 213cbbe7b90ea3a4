"""Runs inside a container: counts tracks, keeps every service's health, prints JSON."""

from __future__ import annotations

import json
import queue
import sys
import time

import zenoh

from heel.schemas import EndOfStream, Health, Stamp, Tracks, decode, keys


def listen(seconds: float, enough: int, deadline_s: float) -> dict[str, object]:
    """Listen at least `seconds`, at most `deadline_s`, until `enough` tracks messages came."""
    config = zenoh.Config.from_json5(
        '{mode: "client", connect: {endpoints: ["tcp/router:7447"], timeout_ms: 10000, '
        "exit_on_failure: true}, scouting: {multicast: {enabled: false}}}"
    )
    samples: queue.Queue[zenoh.Sample] = queue.Queue()
    health: dict[str, object] = {}
    seen = {"tracks": 0, "people": 0, "size": [], "producer": "", "waited_s": 0.0}
    with zenoh.open(config) as session:
        subscribers = [
            session.declare_subscriber(key, samples.put)
            for key in (keys.tracks("front"), keys.ALL_HEALTH)
        ]
        started_s = time.monotonic()
        while (waited_s := time.monotonic() - started_s) < deadline_s:
            if waited_s > seconds and seen["tracks"] >= enough:
                break
            try:
                sample = samples.get(timeout=0.1)
            except queue.Empty:
                continue
            take(sample, seen, health)
            seen["waited_s"] = waited_s
        for subscriber in subscribers:
            subscriber.undeclare()
    return seen | {"health": health}


def take(sample: zenoh.Sample, seen: dict, health: dict) -> None:
    """Book one message."""
    encoding = str(sample.encoding)
    if encoding == EndOfStream.encoding():
        return
    payload = sample.payload.to_bytes()
    if str(sample.key_expr).endswith("/health"):
        said = decode(Health, payload, encoding)
        health[said.service] = said.model_dump(include={"state", "reason", "shared_memory"})
        return
    tracks = decode(Tracks, payload, encoding)
    seen["tracks"] += 1
    seen["people"] = max(seen["people"], sum(track.shown for track in tracks.tracks))
    seen["size"] = [tracks.width, tracks.height]
    seen["producer"] = decode(Stamp, sample.attachment.to_bytes()).producer


print(json.dumps(listen(float(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]))))
