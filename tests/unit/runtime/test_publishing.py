"""Streams go out with a stamp and an end; latched values reach those who come late."""

from __future__ import annotations

import pytest
import zenoh

from heel.schemas import EndOfStream, EStop, FollowState, Progress, Stamp, Target, decode
from heel.schemas.base import MAX_AGE_NS
from heel.services.runtime import qos
from heel.services.runtime.publishing import Latched, StreamPublisher
from tests.support.arrivals import PRODUCER
from tests.support.network import DEADLINE_S, collected, wait_until


def stop(source: str) -> EStop:
    return EStop(engaged=True, source=source)


def asked(session: zenoh.Session, key: str) -> list[EStop]:
    """What a late joiner is told."""
    replies = session.get(key, timeout=2.0)
    return [
        decode(EStop, reply.ok.payload.to_bytes(), str(reply.ok.encoding))
        for reply in replies
        if reply.ok is not None
    ]


@pytest.mark.parametrize(
    ("age_s", "age_ns"),
    [(0.25, 250_000_000), (-1.0, 0), (1e12, MAX_AGE_NS)],
)
def test_results_carry_their_stamp_whatever_the_age(
    age_s: float, age_ns: int, sender: zenoh.Session, receiver: zenoh.Session
) -> None:
    # A key of each case's own: the listener of the case before may still be the one that matches.
    key = f"out/stream/{age_ns}"
    with collected(receiver, key) as samples:
        out = StreamPublisher(sender, key, qos.TRACKS, "live", PRODUCER)
        wait_until(lambda: out.has_listeners, "a listener")
        message = Progress(stream="front", epoch=1, seq=2)
        out.send(message, age_s)
        sample = samples.get(timeout=DEADLINE_S)
    assert decode(Progress, sample.payload.to_bytes(), str(sample.encoding)) == message
    assert sample.attachment is not None
    stamp = decode(Stamp, sample.attachment.to_bytes())
    assert (stamp.producer, stamp.age_ns) == (PRODUCER, age_ns)
    assert (sample.priority, sample.express) == (qos.TRACKS.priority, qos.TRACKS.express)


def test_the_end_comes_behind_the_last_result(
    sender: zenoh.Session, receiver: zenoh.Session
) -> None:
    with collected(receiver, "out/end") as samples:
        out = StreamPublisher(sender, "out/end", qos.TRACKS, "lossless", PRODUCER)
        wait_until(lambda: out.has_listeners, "a listener")
        for seq in range(20):
            out.send(Progress(stream="front", epoch=1, seq=seq), 0.0)
        end = EndOfStream(stream="front", epoch=1, frames=20, reason="end of file")
        out.end(end)
        got = [samples.get(timeout=DEADLINE_S) for _ in range(21)]
    assert [str(s.encoding) for s in got] == [Progress.encoding()] * 20 + [EndOfStream.encoding()]
    assert decode(EndOfStream, got[-1].payload.to_bytes()) == end


def test_listeners_are_noticed_when_they_come_and_go(
    sender: zenoh.Session, receiver: zenoh.Session
) -> None:
    out = StreamPublisher(sender, "out/listeners", qos.TRACKS, "live", PRODUCER)
    assert not out.has_listeners
    with collected(receiver, "out/listeners"):
        wait_until(lambda: out.has_listeners, "the listener")
    wait_until(lambda: not out.has_listeners, "the listener gone")


def test_late_joiners_get_the_newest_latched_value(
    sender: zenoh.Session, receiver: zenoh.Session
) -> None:
    with Latched(sender, "out/latched", qos.ESTOP) as value:
        value.set(stop("first"))
        value.set(stop("second"))
        wait_until(lambda: asked(receiver, "out/latched") == [stop("second")], "the answer")


def test_an_answer_tells_how_long_its_value_has_held(
    sender: zenoh.Session, receiver: zenoh.Session
) -> None:
    def held_s() -> float:
        for reply in receiver.get("out/held"):
            if reply.ok is not None and reply.ok.attachment is not None:
                stamp = decode(Stamp, reply.ok.attachment.to_bytes())
                assert stamp.producer == PRODUCER
                return stamp.age_ns / 1e9
        return -1.0

    with Latched(sender, "out/held", qos.ESTOP, PRODUCER) as value:
        value.keep(stop("one"))
        wait_until(lambda: held_s() > 0.1, "some time")
        value.keep(stop("one"))
        assert held_s() > 0.1, "said again it is no other"
        value.keep(stop("another"))
        assert held_s() < 0.1


def test_a_latched_topic_without_value_answers_nothing(
    sender: zenoh.Session, receiver: zenoh.Session
) -> None:
    with Latched(sender, "out/empty", qos.ESTOP):
        assert asked(receiver, "out/empty") == []


def test_changes_are_published_and_kept_values_are_not(
    sender: zenoh.Session, receiver: zenoh.Session
) -> None:
    with collected(receiver, "out/kept") as samples:
        with Latched(sender, "out/kept", qos.ESTOP) as value:
            value.keep(stop("heard elsewhere"))
            heard = [stop("heard elsewhere")]
            wait_until(lambda: asked(receiver, "out/kept") == heard, "the answer")
            value.set(stop("told"))
            sample = samples.get(timeout=DEADLINE_S)
    assert decode(EStop, sample.payload.to_bytes()) == stop("told")
    assert samples.empty()


def test_after_leaving_nobody_answers(sender: zenoh.Session, receiver: zenoh.Session) -> None:
    with Latched(sender, "out/left", qos.ESTOP) as value:
        value.set(stop("once"))
    wait_until(lambda: asked(receiver, "out/left") == [], "silence")


def test_every_topic_has_room_for_its_largest_message() -> None:
    assert qos.STATE.max_bytes == FollowState.max_bytes
    assert qos.TARGET.max_bytes == Target.max_bytes


def test_motion_commands_are_never_latched_and_no_live_topic_waits_for_a_viewer() -> None:
    assert qos.COMMAND.capacity == 1
    # Frames leave capture that way; the router passes them on without waiting.
    waiting = {
        "IMAGE": zenoh.CongestionControl.BLOCK_FIRST,
        "JPEG": zenoh.CongestionControl.BLOCK_FIRST,
        "DEPTH": zenoh.CongestionControl.BLOCK_FIRST,
        "PROGRESS": zenoh.CongestionControl.BLOCK,  # only lossless runs have any
    }
    topics = {name: value for name, value in vars(qos).items() if isinstance(value, qos.TopicQos)}
    assert len(topics) > 12
    for name, topic in topics.items():
        assert topic.congestion == waiting.get(name, zenoh.CongestionControl.DROP), name
    # What may be lost: the next one comes within 0.1 s, and nobody waits for any of them.
    assert {name for name, topic in topics.items() if topic.best_effort} == {
        "COMMAND", "MANUAL", "DRIVE", "ODOMETRY"
    }  # fmt: skip
    for topic in (qos.COMMAND, qos.ESTOP):
        assert topic.priority == zenoh.Priority.REAL_TIME
        assert topic.express


@pytest.mark.parametrize("topic", [qos.IMAGE, qos.BLOBS, qos.TRACKS, qos.COMMAND])
def test_lossless_delivery_blocks_and_never_overflows_within_the_window(
    topic: qos.TopicQos,
) -> None:
    assert topic.for_delivery("live") == topic
    lossless = topic.for_delivery("lossless")
    assert lossless.congestion == zenoh.CongestionControl.BLOCK
    assert lossless.reliability == zenoh.Reliability.RELIABLE
    assert lossless.capacity > qos.LOSSLESS_WINDOW_FRAMES
    assert (lossless.priority, lossless.max_bytes) == (topic.priority, topic.max_bytes)
