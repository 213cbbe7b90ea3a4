"""Which producer is believed, what is missing, what is refused, and how that is told."""

from __future__ import annotations

import logging

import pytest

from heel.schemas import (
    EndOfStream,
    Header,
    Message,
    Progress,
    Ranges,
    RangeSector,
    Stamp,
    Taken,
    Tracks,
    encode,
)
from heel.services.runtime import qos
from heel.services.runtime.counters import ServiceStatistics
from heel.services.runtime.inbox import Arrival
from heel.services.runtime.logs import OncePerSecond
from heel.services.runtime.streams import (
    END_HOLD_S,
    PRODUCER_STALE_S,
    ProducerGate,
    Received,
    StreamJudge,
)
from tests.support.arrivals import PRODUCER, arrival, arrival_of, frame

_RIVAL = "tracker/other@00000002"


def tracks(seq: int, epoch: int = 1) -> Tracks:
    return Tracks(
        **frame(seq, epoch).model_dump(), width=64, height=48, source_width=64, source_height=48
    )


@pytest.fixture
def judge() -> StreamJudge:
    warn = OncePerSecond(logging.getLogger("heel.test"))
    return StreamJudge("tracks", qos.TRACKS, ServiceStatistics(), warn)


def test_the_first_producer_is_kept_while_it_sends() -> None:
    gate = ProducerGate()
    assert gate.accepts("a", 0.0)
    assert not gate.accepts("b", 0.1)
    assert gate.accepts("a", 0.4)
    assert not gate.accepts("b", 0.8)
    assert gate.current == "a"


def test_another_producer_takes_over_when_the_first_is_stale() -> None:
    gate = ProducerGate()
    gate.accepts("a", 0.0)
    assert not gate.accepts("b", PRODUCER_STALE_S)
    assert gate.accepts("b", PRODUCER_STALE_S + 0.01)
    assert not gate.accepts("c", PRODUCER_STALE_S + 0.02)


def test_a_producer_that_was_only_held_up_gets_its_stream_back_for_good() -> None:
    gate = ProducerGate()
    gate.accepts("a", 0.0)
    assert gate.accepts("b", 0.6)
    assert gate.accepts("a", 0.7)
    assert not gate.accepts("b", 0.8)
    assert gate.rivals(0.8) == ["b"]
    assert gate.accepts("b", 1.4), "silent again"
    assert gate.accepts("a", 1.5)


def test_a_producer_that_was_replaced_long_ago_does_not_come_back() -> None:
    gate = ProducerGate()
    gate.accepts("a", 0.0)
    for step in range(1, 120):
        assert gate.accepts("b", 0.1 * step + 0.5)
    assert not gate.accepts("a", 12.5)


def test_a_last_gasp_now_and_then_does_not_keep_the_stand_in_out() -> None:
    gate = ProducerGate()
    gate.accepts("a", 0.0)
    used = {"a": 0, "b": 0}
    for tick in range(1, 1200):
        now_s = 0.05 * tick
        used["b"] += gate.accepts("b", now_s)
        if tick % 18 == 0:
            used["a"] += gate.accepts("a", now_s)
    assert used["b"] > 0.8 * 1200
    assert 6 <= used["a"] <= 21, "three in ten seconds"


def test_a_rival_under_two_names_does_not_take_the_stream_for_good() -> None:
    gate = ProducerGate()
    gate.accepts("a", 0.0)
    assert gate.accepts("b", 0.6)
    assert gate.accepts("c", 1.2)
    assert not gate.accepts("b", 1.3), "it was no more than a stand-in"
    assert gate.accepts("a", 1.4)
    assert not gate.accepts("c", 1.5)


@pytest.mark.parametrize("epoch", [1, 2], ids=["the same camera", "another camera"])
def test_a_recording_of_a_dead_producer_does_not_silence_the_stand_in(
    judge: StreamJudge, epoch: int
) -> None:
    for seq in range(10):
        assert judge.message(arrival_of(tracks(seq), 10.0 + 0.1 * seq), Tracks)
    for step in range(100):
        now_s = 12.0 + 0.1 * step
        stand_in = arrival_of(tracks(20 + step, epoch), now_s, producer=_RIVAL)
        assert judge.message(stand_in, Tracks)
        assert not judge.message(arrival_of(tracks(step % 10), now_s + 0.05), Tracks)
    assert judge.gate.current == _RIVAL


def test_rivals_are_named_while_they_are_heard() -> None:
    gate = ProducerGate()
    gate.accepts("a", 0.0)
    gate.accepts("c", 0.1)
    gate.accepts("b", 0.2)
    assert gate.rivals(0.3) == ["b", "c"]
    assert gate.rivals(2.15) == ["b"]
    assert gate.rivals(5.0) == []


def test_a_rival_that_takes_over_is_no_rival_any_more() -> None:
    gate = ProducerGate()
    gate.accepts("a", 0.0)
    gate.accepts("b", 0.1)
    assert gate.accepts("b", 1.0)
    assert gate.rivals(1.0) == []


def test_endless_new_producers_do_not_fill_the_memory() -> None:
    gate = ProducerGate()
    for number in range(1000):
        gate.accepts(f"p{number}", 0.0)
    assert len(gate.rivals(0.0)) <= 16


def test_good_messages_are_received_with_stamp_and_age(judge: StreamJudge) -> None:
    received = judge.message(arrival_of(tracks(3), 10.0, age_ns=250_000_000), Tracks)
    assert received is not None
    assert received.message == tracks(3)
    assert received.stamp.producer == PRODUCER
    assert received.age_s(10.5) == pytest.approx(0.75)
    assert received.age_s(9.0) == pytest.approx(0.25)
    assert judge.statistics.malformed == 0


_GOOD = encode(tracks(0))
_STAMP = encode(Stamp(producer=PRODUCER, t_sent_ns=0, age_ns=0))
_END = encode(EndOfStream(stream="front", epoch=1, frames=1, reason="end"))


@pytest.mark.parametrize(
    ("payload", "encoding", "attachment", "words"),
    [
        (b"", Tracks.encoding(), _STAMP, "tracks: not msgpack"),
        (b"\xc1garbage", Tracks.encoding(), _STAMP, "tracks: not msgpack"),
        (_GOOD[:-1], Tracks.encoding(), _STAMP, "tracks: not msgpack"),
        (_GOOD, "application/x-msgpack;tracks.v2", _STAMP, "tracks.v2"),
        (_GOOD, "application/json", _STAMP, "application/json"),
        (_GOOD, "", _STAMP, "encoding ''"),
        (_GOOD.replace(b"\xa1v\x01", b"\xa1v\x02"), Tracks.encoding(), _STAMP, "version 2"),
        (bytes(qos.TRACKS.max_bytes + 1), Tracks.encoding(), _STAMP, "exceed the cap of 262144"),
        (_GOOD, Tracks.encoding(), None, "stamp: not msgpack"),
        (_GOOD, Tracks.encoding(), b"", "stamp: not msgpack"),
        (_GOOD, Tracks.encoding(), bytes(10_000), "stamp: 10000 bytes exceed the cap of 768"),
        (_END, Tracks.encoding(), _STAMP, "tracks: seq"),
    ],
    ids=["empty", "garbage", "cut off", "encoding version", "JSON", "no encoding", "version",
         "oversized", "no stamp", "empty stamp", "oversized stamp", "another message"],
)  # fmt: skip
def test_malformed_messages_are_counted_named_and_dropped(
    payload: bytes, encoding: str, attachment: bytes | None, words: str,
    judge: StreamJudge, caplog: pytest.LogCaptureFixture,
) -> None:  # fmt: skip
    bad = arrival(payload, encoding, attachment)
    assert judge.message(bad, Tracks) is None
    assert judge.statistics.malformed == 1
    (line,) = caplog.messages
    assert line.startswith("cam/front/tracks: ")
    assert words in line
    assert judge.message(arrival_of(tracks(0)), Tracks) is not None


def test_malformed_messages_are_told_once_a_second(
    judge: StreamJudge, caplog: pytest.LogCaptureFixture
) -> None:
    for step in range(30):
        judge.message(arrival(b"", Tracks.encoding(), None, 50.0 + step * 0.05), Tracks)
    assert judge.statistics.malformed == 30
    assert len(caplog.messages) == 2
    assert caplog.messages[1].endswith("(19 more like it)")


def test_malformed_messages_leave_producer_and_sequence_as_they_were(judge: StreamJudge) -> None:
    stamp = encode(Stamp(producer=_RIVAL, t_sent_ns=0, age_ns=0))
    judge.message(arrival(b"\xc1", Tracks.encoding(), stamp), Tracks)
    assert judge.gate.current is None
    assert judge.message(arrival_of(tracks(0)), Tracks) is not None


@pytest.mark.parametrize("payload", [b"", b"\xc1", _GOOD, _END[:-1]])
def test_malformed_ends_do_not_end_the_stream(payload: bytes, judge: StreamJudge) -> None:
    assert judge.end(arrival(payload, EndOfStream.encoding(), None)) is None
    assert judge.statistics.malformed == 1


def test_an_end_counts_only_under_its_own_encoding(judge: StreamJudge) -> None:
    assert judge.end(arrival(_END, "application/x-msgpack;end.v2", None)) is None
    end = judge.end(arrival(_END, EndOfStream.encoding(), None))
    assert end is not None
    assert end.frames == 1


def test_headers_of_images_are_judged_without_touching_the_pixels(judge: StreamJudge) -> None:
    header = Header(
        **frame(0).model_dump(), width=2, height=2, source_width=2, source_height=2,
        image_encoding="image/raw;bgr8", producer="capture/main@00000003",
    )  # fmt: skip
    pixels = arrival(bytes(12), "image/raw;bgr8", encode(header))
    assert judge.header(pixels) == header
    assert judge.header(pixels) is None, "the same frame again"
    assert judge.header(arrival(bytes(12), "image/raw;bgr8", None)) is None
    assert judge.header(arrival(bytes(qos.TRACKS.max_bytes + 1), "", encode(header))) is None
    assert judge.statistics.malformed == 2


def test_gaps_are_the_dropped_frames_of_the_primary_stream_only(judge: StreamJudge) -> None:
    for message in (tracks(0), tracks(4)):
        judge.message(arrival_of(message), Tracks)
    assert judge.statistics.dropped == 3
    judge.primary = False
    judge.message(arrival_of(tracks(9)), Tracks)
    assert judge.statistics.dropped == 3


def test_two_live_producers_are_a_problem_that_names_both(
    judge: StreamJudge, caplog: pytest.LogCaptureFixture
) -> None:
    for step in range(10):
        assert judge.message(arrival_of(tracks(step), step * 0.04), Tracks) is not None
        assert judge.message(arrival_of(tracks(step), step * 0.04, _RIVAL), Tracks) is None
    (problem,) = judge.statistics.problems()
    assert f"{PRODUCER} (in use) and {_RIVAL}" in problem
    assert caplog.messages == [problem]
    assert judge.message(arrival_of(tracks(10), 2.5), Tracks) is not None
    assert judge.statistics.problems() == []


def test_a_replaced_producer_goes_on_where_the_first_stopped(judge: StreamJudge) -> None:
    judge.message(arrival_of(tracks(5), 0.0), Tracks)
    assert judge.message(arrival_of(tracks(5), 1.0, _RIVAL), Tracks) is None, "seen already"
    assert judge.message(arrival_of(tracks(6), 1.1, _RIVAL), Tracks) is not None
    assert judge.statistics.problems() == []


def test_messages_without_a_frame_are_not_judged_by_sequence(judge: StreamJudge) -> None:
    progress: Message = Progress(stream="front", epoch=1, seq=0)
    for _ in range(2):
        assert judge.message(arrival_of(progress), Progress) is not None


def ranges(seq: int, distance_m: float = 2.0) -> Ranges:
    ahead = RangeSector(bearing_rad=0.0, width_rad=0.2, distance_m=distance_m)
    return Ranges(seq=seq, sectors=(ahead,))


def test_measurements_have_one_producer_and_count_up(judge: StreamJudge) -> None:
    assert judge.message(arrival_of(ranges(7), 0.0), Ranges) is not None
    assert judge.message(arrival_of(ranges(900), 0.1, _RIVAL), Ranges) is None
    assert judge.message(arrival_of(ranges(8), 0.2), Ranges) is not None
    assert judge.message(arrival_of(ranges(8), 0.3), Ranges) is None, "the same again"
    assert "two producers" in judge.statistics.problems()[0]


def test_beacons_count_within_their_epoch(judge: StreamJudge) -> None:
    def beacon(seq: int) -> Taken:
        return Taken(stream="front", epoch=5, seq=seq, clock="c", monotonic_ns=1)

    assert judge.message(arrival_of(beacon(3)), Taken) is not None
    assert judge.message(arrival_of(beacon(3)), Taken) is None
    assert judge.watch.line == 5


def test_messages_may_be_left_to_the_caller_to_judge(judge: StreamJudge) -> None:
    for producer in (PRODUCER, _RIVAL):
        assert judge.message(arrival_of(ranges(1), 0.0, producer), Ranges, False) is not None
    assert judge.gate.current is None


def test_nothing_but_refused_messages_is_a_problem_until_one_is_good_or_none_comes(
    judge: StreamJudge,
) -> None:
    for seq in (0, 1):
        judge.message(arrival_of(tracks(seq), 0.1 * seq), Tracks)
    for step in range(8):
        judge.message(arrival_of(tracks(0), 0.2 + step * 0.1), Tracks)
    (problem,) = judge.statistics.problems(1.0)
    assert problem.startswith("cam/front/tracks: every message is refused: tracker/main@00000001: ")
    assert judge.statistics.problems(10.0) == []
    judge.message(arrival_of(tracks(0), 11.0), Tracks)
    judge.message(arrival_of(tracks(2), 11.1), Tracks)
    assert judge.statistics.problems(11.1) == []


def test_what_cannot_be_read_is_told_unless_a_rival_sent_it(judge: StreamJudge) -> None:
    judge.message(arrival_of(ranges(0), 0.0), Ranges)
    assert judge.unreadable == ""
    for producer, told in ((PRODUCER, True), (_RIVAL, False)):
        stamp = encode(Stamp(producer=producer, t_sent_ns=0, age_ns=0))
        assert judge.message(arrival(b"\xc1", Ranges.encoding(), stamp, 0.1), Ranges) is None
        assert bool(judge.unreadable) == told
    assert judge.message(arrival(b"\xc1", Ranges.encoding(), None, 0.1), Ranges) is None
    assert judge.unreadable.startswith("stamp: not msgpack")


def test_what_cannot_be_read_is_a_senders_who_lives_if_its_stamp_is_newer_than_all_before(
    judge: StreamJudge,
) -> None:
    known = []
    for t_sent_ns in (5, 6, 6, 4, 7):
        stamp = encode(Stamp(producer=PRODUCER, t_sent_ns=t_sent_ns, age_ns=0))
        judge.message(arrival(b"\xc1", Ranges.encoding(), stamp, 0.1), Ranges)
        known.append(judge.unreadable_known)
    assert known == [True, True, False, False, True]
    judge.message(arrival(b"\xc1", Ranges.encoding(), None, 0.1), Ranges)
    assert not judge.unreadable_known


def end_of(frames: int, epoch: int = 1, arrived_s: float = 0.1) -> Arrival:
    end = EndOfStream(stream="front", epoch=epoch, frames=frames, reason="end")
    return arrival(encode(end), end.encoding(), None, arrived_s)


@pytest.mark.parametrize(("frames", "epoch"), [(3, 1), (0, 1), (4, 2), (2**63 - 1, 5)])
def test_an_end_of_another_epoch_or_from_before_the_last_frame_is_refused(
    frames: int, epoch: int, judge: StreamJudge
) -> None:
    for seq in range(4):
        judge.message(arrival_of(tracks(seq), 0.0), Tracks)
    judge.ending(end_of(frames, epoch))
    assert judge.ended(99.0) is None
    assert judge.statistics.malformed == 1


def test_an_end_holds_once_nothing_has_followed_it(judge: StreamJudge) -> None:
    judge.message(arrival_of(tracks(0), 0.0), Tracks)
    judge.ending(end_of(1))
    assert judge.ended(0.1 + 0.9 * END_HOLD_S) is None
    end = judge.ended(0.1 + END_HOLD_S)
    assert end is not None
    assert end.frames == 1
    assert judge.ended(9.0) is None, "once"


def test_an_end_that_frames_follow_was_somebody_elses(
    judge: StreamJudge, caplog: pytest.LogCaptureFixture
) -> None:
    judge.message(arrival_of(tracks(0), 0.0), Tracks)
    judge.ending(end_of(1))
    judge.message(arrival_of(tracks(1), 0.14), Tracks)
    assert judge.ended(9.0) is None
    assert "is not believed" in caplog.text


@pytest.mark.parametrize(("frames", "at_once"), [(1, True), (9, False)])
def test_without_loss_an_end_right_behind_the_last_frame_holds_at_once(
    frames: int, at_once: bool, judge: StreamJudge
) -> None:
    lossless = StreamJudge("tracks", qos.TRACKS, judge.statistics, judge.warn, live=False)
    lossless.message(arrival_of(tracks(0), 0.0), Tracks)
    lossless.ending(end_of(frames))
    assert (lossless.ended(0.1) is not None) == at_once
    assert at_once or lossless.ended(0.1 + END_HOLD_S) is not None


def test_an_end_before_the_first_frame_waits_for_a_camera_that_starts(judge: StreamJudge) -> None:
    judge.ending(end_of(3))
    assert judge.ended(3.0) is None
    judge.message(arrival_of(tracks(0), 3.1), Tracks)
    assert judge.ended(99.0) is None
    other = StreamJudge("tracks", qos.TRACKS, judge.statistics, judge.warn)
    other.ending(end_of(0))
    assert other.ended(6.0) is not None


def test_a_frame_is_no_younger_than_the_time_since_it_was_taken() -> None:
    stamp = Stamp(producer=PRODUCER, t_sent_ns=0, age_ns=50_000_000)
    assert Received(tracks(0), stamp, 10.0).age_s(10.1) == pytest.approx(0.15)
    assert Received(tracks(0), stamp, 10.0, 9.0).age_s(10.1) == pytest.approx(1.1)
    assert Received(tracks(0), stamp, 10.0, 10.09).age_s(10.1) == pytest.approx(0.15)


def test_one_that_takes_over_the_line_is_believed_at_once_and_for_good() -> None:
    gate = ProducerGate()
    assert gate.accepts("a", 0.0)
    assert not gate.accepts("c", 0.01, line="c", turn=5), "another line"
    assert gate.accepts("b", 0.04, line="a", turn=1)
    assert not gate.accepts("a", 0.05)
    assert not gate.accepts("c", 0.06, line="a", turn=1), "the same turn"
    for step in range(20):
        assert gate.accepts("b", 0.08 + 0.04 * step, line="a", turn=1)
        assert not gate.accepts("a", 0.09 + 0.04 * step), "it was held up, and is behind by now"
    assert gate.accepts("a", 0.9, line="a", turn=2), "handed back"


def test_ids_of_a_line_are_those_of_the_process_that_began_it() -> None:
    first = Stamp(producer=PRODUCER, t_sent_ns=0, age_ns=0)
    second = Stamp(producer=_RIVAL, t_sent_ns=0, age_ns=0, line=PRODUCER, turn=1)
    assert first.origin == second.origin == PRODUCER
