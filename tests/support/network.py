"""A private router on a free loopback port, client sessions, and waiting with a deadline."""

from __future__ import annotations

import json
import queue
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import zenoh

from heel.services.runtime.router import open_private_router

DEADLINE_S = 10.0
"""For what takes milliseconds: reached only when it never comes."""


@contextmanager
def router() -> Iterator[str]:
    """A router of one's own; yields its endpoint."""
    with open_private_router() as (_, endpoint):
        yield endpoint


def free_port() -> int:
    """A loopback port at which nobody listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def client(endpoint: str) -> Iterator[zenoh.Session]:
    """A session that is a client of the router at `endpoint`."""
    config = zenoh.Config()
    for path, value in (
        ("mode", "client"),
        ("connect/endpoints", [endpoint]),
        ("scouting/multicast/enabled", False),
        ("queries_default_timeout", 2000),
    ):
        config.insert_json5(path, json.dumps(value))
    with zenoh.open(config) as session:
        yield session


@contextmanager
def collected(session: zenoh.Session, key: str) -> Iterator[queue.Queue[zenoh.Sample]]:
    """Everything that arrives on `key`, as a queue."""
    samples: queue.Queue[zenoh.Sample] = queue.Queue()
    subscriber = session.declare_subscriber(key, samples.put)
    try:
        yield samples
    finally:
        subscriber.undeclare()


def wait_until(condition: Callable[[], bool], what: str, deadline_s: float = DEADLINE_S) -> None:
    """Wait for a condition that another thread or process brings about.

    Raises:
        AssertionError: it did not come in time.
    """
    never = threading.Event()
    end_s = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < end_s, f"{what}: not within {deadline_s:g} s"
        never.wait(0.005)


def wait_for_listener(publisher: zenoh.Publisher) -> None:
    """Wait until somebody subscribes to what the publisher sends."""
    wait_until(lambda: publisher.matching_status.matching, f"a listener on {publisher.key_expr}")
