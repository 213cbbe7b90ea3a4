"""What arrives on one host: ages of commands and states, and frames that were worked on.

Run as a process on that host: python -m benchmarks.links.probe ENDPOINT SECONDS
Prints one JSON object. Ages are of the sender's clock, which on one machine is everybody's.
"""

from __future__ import annotations

import functools
import json
import logging
import sys
import threading
import time
from collections import defaultdict

import zenoh

from heel.schemas import MessageError, Stamp, decode, keys
from heel.services.runtime.process import die_with_parent
from heel.services.runtime.session import open_session
from heel.services.runtime.settings import ZenohSettings

STREAMS = {"command": keys.FOLLOW_COMMAND, "blobs": keys.TOPICS["blobs"],
           "tracks": keys.ALL_TRACKS, "drive": keys.ROBOT_DRIVE}  # fmt: skip


def listen(session: zenoh.Session, seconds: float) -> dict[str, list[float]]:
    """Seconds from sending to arrival of every message, by stream."""
    ages_s: defaultdict[str, list[float]] = defaultdict(list)

    def hear(name: str, sample: zenoh.Sample) -> None:
        if sample.attachment is None:
            return
        try:
            stamp = decode(Stamp, sample.attachment.to_bytes())
        except MessageError:
            return
        ages_s[name].append(time.time() - stamp.t_sent_ns / 1e9)

    subscribers = [
        session.declare_subscriber(key, functools.partial(hear, name))
        for name, key in STREAMS.items()
    ]
    time.sleep(seconds)
    for subscriber in subscribers:
        subscriber.undeclare()  # type: ignore[no-untyped-call]
    return dict(ages_s)


def main() -> None:
    """Listen for so long and print."""
    die_with_parent()
    settings = ZenohSettings(connect=(sys.argv[1],), connect_timeout_s=30.0)
    session = open_session(settings, logging.getLogger("probe"), threading.Event().wait)
    assert session is not None
    with session:
        print(json.dumps(listen(session, float(sys.argv[2]))), flush=True)


if __name__ == "__main__":
    main()
