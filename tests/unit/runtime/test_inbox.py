"""Mailboxes: bounded, newest wins, every wait ends."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import pytest
import zenoh

from heel.services.runtime import qos
from heel.services.runtime.inbox import Inbox
from tests.support.network import DEADLINE_S, wait_for_listener, wait_until


@pytest.fixture
def inbox(receiver: zenoh.Session) -> Iterator[Inbox]:
    with Inbox(receiver) as box:
        yield box


def publisher(session: zenoh.Session, key: str) -> zenoh.Publisher:
    """A publisher that has found its subscriber."""
    made = session.declare_publisher(key, congestion_control=zenoh.CongestionControl.BLOCK)
    wait_for_listener(made)
    return made


def pass_all(inbox: Inbox, topic: str, out: zenoh.Publisher, count: int) -> None:
    """Send `count` messages one by one, each seen by the inbox, none taken."""
    ring = inbox._rings[topic]
    for number in range(count):
        wanted = str(number).encode()
        out.put(wanted)
        wait_until(lambda w=wanted: bool(ring) and ring[-1].payload == w, f"message {number}")


def test_messages_come_with_payload_encoding_attachment_and_time(
    inbox: Inbox, sender: zenoh.Session
) -> None:
    inbox.subscribe("tracks", "inbox/1", qos.TRACKS)
    out = publisher(sender, "inbox/1")
    before_s = time.monotonic()
    out.put(b"pay", encoding="application/x-msgpack;tracks.v1", attachment=b"att")
    arrival = inbox.get(DEADLINE_S)
    assert arrival is not None
    assert (arrival.topic, arrival.key) == ("tracks", "inbox/1")
    assert (arrival.payload, arrival.attachment, arrival.size) == (b"pay", b"att", 3)
    assert arrival.encoding == "application/x-msgpack;tracks.v1"
    assert before_s <= arrival.arrived_s <= time.monotonic()
    assert not arrival.by_shared_memory


def test_a_missing_attachment_is_none(inbox: Inbox, sender: zenoh.Session) -> None:
    inbox.subscribe("tracks", "inbox/2", qos.TRACKS)
    publisher(sender, "inbox/2").put(b"x")
    arrival = inbox.get(DEADLINE_S)
    assert arrival is not None
    assert arrival.attachment is None


@pytest.mark.parametrize("topic_qos", [qos.IMAGE, qos.TRACKS, qos.ESTOP], ids=["1", "2", "8"])
def test_a_loop_that_is_behind_finds_the_newest_messages_in_order(
    topic_qos: qos.TopicQos, inbox: Inbox, sender: zenoh.Session
) -> None:
    key = f"inbox/ring{topic_qos.capacity}"
    inbox.subscribe("topic", key, topic_qos)
    count = topic_qos.capacity + 5
    pass_all(inbox, "topic", publisher(sender, key), count)
    kept = [inbox.get(0) for _ in range(topic_qos.capacity)]
    assert [int(a.payload) for a in kept if a] == list(range(5, count))
    assert inbox.get(0) is None
    assert inbox.overflowed["topic"] == 5


def test_latest_forgets_and_counts_what_is_older(inbox: Inbox, sender: zenoh.Session) -> None:
    inbox.subscribe("estop", "inbox/3", qos.ESTOP)
    assert inbox.latest("estop") is None
    pass_all(inbox, "estop", publisher(sender, "inbox/3"), 4)
    newest = inbox.latest("estop")
    assert newest is not None
    assert newest.payload == b"3"
    assert inbox.get(0) is None
    assert inbox.overflowed["estop"] == 3


def test_of_several_topics_the_longest_waiting_message_comes_first(
    inbox: Inbox, sender: zenoh.Session
) -> None:
    outs = {}
    for topic in ("a", "b"):
        inbox.subscribe(topic, f"inbox/order/{topic}", qos.ESTOP)
        outs[topic] = publisher(sender, f"inbox/order/{topic}")
    for topic in ("b", "a", "b"):
        held = len(inbox._rings[topic])
        outs[topic].put(b"x")
        wait_until(lambda t=topic, n=held: len(inbox._rings[t]) > n, "the message")
    got = [inbox.get(0) for _ in range(3)]
    assert [a.topic for a in got if a] == ["b", "a", "b"]


def test_only_the_topics_asked_for_are_taken(inbox: Inbox, sender: zenoh.Session) -> None:
    for topic in ("a", "b"):
        inbox.subscribe(topic, f"inbox/only/{topic}", qos.ESTOP)
    out = publisher(sender, "inbox/only/a")
    pass_all(inbox, "a", out, 1)
    assert inbox.get(0.01, "b") is None
    arrival = inbox.get(0, "b", "a")
    assert arrival is not None
    assert arrival.topic == "a"


@pytest.mark.parametrize("timeout_s", [0.0, 0.05])
def test_an_empty_inbox_gives_up_at_the_deadline(timeout_s: float, inbox: Inbox) -> None:
    inbox.subscribe("tracks", "inbox/nothing", qos.TRACKS)
    started_s = time.monotonic()
    assert inbox.get(timeout_s) is None
    assert timeout_s <= time.monotonic() - started_s < timeout_s + 1.0


def test_a_message_wakes_the_waiting_loop(inbox: Inbox, sender: zenoh.Session) -> None:
    inbox.subscribe("tracks", "inbox/wake", qos.TRACKS)
    out = publisher(sender, "inbox/wake")
    threading.Timer(0.05, out.put, (b"x",)).start()
    assert inbox.get(DEADLINE_S) is not None


def test_leaving_ends_every_thread(receiver: zenoh.Session) -> None:
    before = set(threading.enumerate())
    with Inbox(receiver) as box:
        for topic in ("a", "b", "c"):
            box.subscribe(topic, f"inbox/leave/{topic}", qos.TRACKS)
        started = set(threading.enumerate()) - before
        assert len(started) == 3
    assert not any(thread.is_alive() for thread in started)


def test_a_slow_loop_does_not_delay_a_stop(inbox: Inbox, sender: zenoh.Session) -> None:
    """The reason for rings: behind a full FIFO of frames a stop message was 2 to 4 s late."""
    inbox.subscribe("image", "inbox/slow/image", qos.IMAGE)
    inbox.subscribe("estop", "inbox/slow/estop", qos.ESTOP)
    images = publisher(sender, "inbox/slow/image")
    stop = sender.declare_publisher(
        "inbox/slow/estop", priority=zenoh.Priority.REAL_TIME, express=True
    )
    wait_for_listener(stop)
    frame = bytes(300_000)
    for _ in range(50):
        images.put(frame)
    started_s = time.monotonic()
    stop.put(b"stop")
    assert inbox.get(DEADLINE_S, "estop") is not None
    assert time.monotonic() - started_s < 1.0
    assert len(inbox._rings["image"]) <= 1


def test_of_messages_beyond_their_cap_one_is_kept(inbox: Inbox, sender: zenoh.Session) -> None:
    inbox.subscribe("health", "large/x", qos.HEALTH)
    out = publisher(sender, "large/x")
    for _ in range(4):
        out.put(bytes(qos.HEALTH.max_bytes + 1))
    out.put(b"last")
    ring = inbox._rings["health"]
    wait_until(lambda: bool(ring) and ring[-1].payload == b"last", "the last message")
    assert [one.size for one in ring] == [qos.HEALTH.max_bytes + 1, 4]
    assert inbox.overflowed["health"] == 3
