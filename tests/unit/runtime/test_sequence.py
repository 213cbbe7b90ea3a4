"""What is new in a stream, and that one odd message can neither lead it away nor end it."""

from __future__ import annotations

import random

import pytest

from heel.services.runtime.sequence import RESUME_S, SequenceWatch

_PERIOD_S = 0.04
_LAST = 2**63 - 1


def watched(seqs: list[int], live: bool = True) -> tuple[SequenceWatch, list[bool]]:
    """Numbers of one line, one every 40 ms."""
    watch = SequenceWatch(live)
    return watch, [watch.fresh(1, seq, at * _PERIOD_S) for at, seq in enumerate(seqs)]


def running(count: int = 5) -> tuple[SequenceWatch, float]:
    """A line that has come to `count` - 1, and when its next message is due."""
    return watched(list(range(count)))[0], count * _PERIOD_S


@pytest.mark.parametrize(
    ("seqs", "fresh", "missing"),
    [
        ([0, 1, 2], [True, True, True], 0),
        ([5, 6], [True, True], 0),
        ([0, 3, 4], [True, True, True], 2),
        ([0, 0, 1], [True, False, True], 0),
        ([0, 1, 2, 1, 0, 3], [True, True, True, False, False, True], 0),
        ([0, 10, 11, 1, 12], [True, True, True, False, True], 9),
        ([0, 1, 6, 3, 7], [True, True, True, False, True], 4),
    ],
)
def test_gaps_are_counted_and_old_numbers_refused(
    seqs: list[int], fresh: list[bool], missing: int
) -> None:
    watch, said = watched(seqs)
    assert said == fresh
    assert watch.missing == missing


@pytest.mark.parametrize("leap", [10, 50, 1000, 10**6, 2**62, _LAST])
def test_one_leap_costs_a_running_stream_nothing(leap: int) -> None:
    watch, now_s = running()
    watch.fresh(1, min(4 + leap, _LAST), now_s)
    said = [watch.fresh(1, 5 + step, now_s + 0.01 + step * _PERIOD_S) for step in range(10)]
    assert all(said)
    assert (watch.seq, watch.missing) == (14, 0)


@pytest.mark.parametrize("first", [_LAST, 2**40, 7])
@pytest.mark.parametrize("epoch", [1, 2])
def test_a_stream_recovers_from_an_odd_message_before_its_first(first: int, epoch: int) -> None:
    watch = SequenceWatch()
    assert watch.fresh(epoch, first, 0.0)
    said = [watch.fresh(1, seq, 0.01 + seq * _PERIOD_S) for seq in range(10)]
    assert all(said[8:]), said
    assert sum(said) >= 2


def test_a_stream_recovers_within_a_second_from_a_line_that_led_it_away_while_it_was_silent() -> (
    None
):
    watch, now_s = running()
    now_s += RESUME_S
    assert not watch.fresh(1, 2**62, now_s + 0.1)
    assert watch.fresh(1, 2**62 + 1, now_s + 0.2)
    said = [watch.fresh(1, 5 + step, now_s + 0.21 + step * _PERIOD_S) for step in range(25)]
    assert all(said[15:])


def test_another_epoch_is_followed_once_the_first_is_silent_and_a_second_message_goes_on() -> None:
    watch, now_s = running()
    assert not watch.fresh(2, 0, now_s)
    assert not watch.fresh(2, 1, now_s + 0.1), "the first epoch was there a moment ago"
    assert watch.fresh(2, 2, now_s + RESUME_S)
    assert watch.line == 2
    assert watch.missing == 0


def test_without_loss_another_epoch_is_followed_at_once() -> None:
    watch, _ = watched([0, 1, 2], live=False)
    assert watch.fresh(2, 0, 0.2)


def test_a_new_producer_may_begin_another_epoch_at_once() -> None:
    watch, now_s = running()
    assert watch.fresh(2, 0, now_s, replaced=True)


def test_one_frozen_frame_under_alternating_epochs_is_never_new() -> None:
    watch, now_s = running()
    said = [watch.fresh(1 + step % 2, 4, now_s + step * _PERIOD_S) for step in range(200)]
    assert not any(said)


def test_one_frozen_frame_under_ever_new_epochs_is_never_new() -> None:
    watch, now_s = running()
    said = [watch.fresh(100 + step, 4, now_s + step * _PERIOD_S) for step in range(200)]
    assert not any(said)


def test_a_recording_of_an_epoch_that_was_left_does_not_come_back() -> None:
    watch, now_s = running(50)
    for step in range(30):
        watch.fresh(2, step, now_s + step * _PERIOD_S)
    assert watch.line == 2
    later_s = now_s + 5.0
    assert not any(watch.fresh(1, step, later_s + step * _PERIOD_S) for step in range(50))


def test_a_recording_of_the_present_epoch_is_old() -> None:
    watch, now_s = running(50)
    assert not any(watch.fresh(1, step, now_s + 5.0 + step * _PERIOD_S) for step in range(50))


def test_a_producer_that_comes_back_goes_on_from_where_it_was() -> None:
    watch = SequenceWatch()
    assert [watch.fresh("a", seq, seq * _PERIOD_S) for seq in range(3)] == [True] * 3
    assert watch.fresh("b", 0, 1.0, replaced=True)
    assert watch.fresh("b", 1, 1.1)
    assert not watch.fresh("a", 1, 2.0, replaced=True), "said before"
    assert watch.fresh("a", 40, 2.1, replaced=True)


def test_a_producer_that_came_back_and_went_again_repeats_nothing_of_either_time() -> None:
    watch = SequenceWatch()
    for now_s, name, seqs in ((0.0, "a", (0, 1)), (1.0, "b", (0, 1)), (1.2, "a", (20, 40)),
                              (3.0, "b", (9, 10))):  # fmt: skip
        for step, seq in enumerate(seqs):
            assert watch.fresh(name, seq, now_s + 0.1 * step, replaced=step == 0)
    assert not watch.fresh("a", 30, 3.2, replaced=True)
    assert watch.line == "b"


def test_refusals_say_why() -> None:
    watch, now_s = running()
    watch.fresh(1, _LAST, now_s)
    assert watch.refusal == f"seq {_LAST} does not follow 4"
    watch.fresh(1, 2, now_s)
    assert "was there before" in watch.refusal
    watch.fresh(9, 0, now_s)
    assert watch.refusal == "seq 0 counts within 9, while 1 is in use"


@pytest.mark.parametrize("seed", range(20))
def test_whatever_comes_before_it_a_true_stream_is_heard_within_a_second(seed: int) -> None:
    """Everybody may send anything for a while; then the camera goes on alone."""
    odd = random.Random(seed)
    watch, now_s, seq = SequenceWatch(), 0.0, 0
    for _ in range(odd.randrange(1, 200)):
        now_s += odd.choice([0.0, 0.001, _PERIOD_S, 0.7])
        if odd.random() < 0.5:
            watch.fresh(1, seq, now_s)
            seq += odd.choice([1, 1, 1, 5])
        else:
            line = odd.choice([1, 1, 2, odd.randrange(2**63)])
            watch.fresh(line, odd.choice([0, seq + 3, _LAST, odd.randrange(2**63)]), now_s)
    said = [watch.fresh(1, seq + step, now_s + (1 + step) * _PERIOD_S) for step in range(50)]
    assert all(said[25:]), said


def test_memory_is_bounded() -> None:
    watch = SequenceWatch()
    for step in range(5000):
        watch.fresh(step // 2, step, step * 0.6)
    assert len(watch._former) <= 64
    assert len(watch._candidates) <= 16
