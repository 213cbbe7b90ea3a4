"""How old frames are by their camera's beacon: never younger than told, whatever is forged."""

from __future__ import annotations

import random

import pytest

from heel.schemas import Taken
from heel.services.follower.frame_times import SILENT_S, FrameTimes
from tests.support.arrivals import frame

_CLOCK = "0123abcd-4026531834"


def beacon(seq: int, taken_s: float, epoch: int = 1, clock: str = _CLOCK) -> Taken:
    return Taken(
        stream="front", epoch=epoch, seq=seq, clock=clock, monotonic_ns=round(taken_s * 1e9)
    )


@pytest.fixture
def times() -> FrameTimes:
    """Frames 0 to 9, taken every 50 ms from second 100 on and told 1 ms later."""
    made = FrameTimes(_CLOCK)
    for seq in range(10):
        made.hear(beacon(seq, 100 + 0.05 * seq), 100.001 + 0.05 * seq)
    return made


def test_a_frame_is_as_old_as_its_beacon(times: FrameTimes) -> None:
    assert times.taken_s(frame(7), 101.0) == (pytest.approx(100.35), "")
    assert times.same_clock


def test_a_frame_whose_beacon_is_missing_is_as_old_as_the_one_before() -> None:
    times = FrameTimes(_CLOCK)
    for seq in (0, 1, 5):
        times.hear(beacon(seq, 100 + 0.05 * seq), 100 + 0.05 * seq)
    assert times.taken_s(frame(4), 101.0) == (pytest.approx(100.05), "")
    assert times.taken_s(frame(6), 101.0) == (pytest.approx(100.25), "")


def test_another_hosts_clock_means_nothing_and_arrival_counts() -> None:
    times = FrameTimes(_CLOCK)
    times.hear(beacon(0, 5.0, clock="ffff-0"), 100.25)
    assert times.taken_s(frame(0), 100.3) == (100.25, "")
    assert not times.same_clock


def test_a_frame_cannot_have_been_taken_after_its_beacon_came() -> None:
    times = FrameTimes(_CLOCK)
    times.hear(beacon(0, 9e9), 100.0)
    assert times.taken_s(frame(0), 100.1) == (100.0, "")


def test_without_a_beacon_nothing_is_known_and_nothing_wrong(times: FrameTimes) -> None:
    assert FrameTimes(_CLOCK).taken_s(frame(0), 100.0) == (None, "")
    later_s = 100.451 + SILENT_S + 0.1
    assert times.taken_s(frame(0, epoch=2), later_s) == (None, "")


def test_frames_of_another_epoch_than_the_cameras_are_wrong(times: FrameTimes) -> None:
    taken_s, wrong = times.taken_s(frame(7, epoch=2), 101.0)
    assert taken_s is None
    assert wrong == "epoch 2 is not the camera's, which is 1"


def test_frames_from_before_the_first_beacon_are_wrong() -> None:
    times = FrameTimes(_CLOCK)
    times.hear(beacon(50, 100.0), 100.0)
    assert "too long ago" in times.taken_s(frame(49), 100.0)[1]


def test_beacons_of_frames_to_come_give_way_to_the_true_ones(times: FrameTimes) -> None:
    times.hear(beacon(5000, 100.5), 100.5)
    times.hear(beacon(10, 100.5), 100.501)
    assert times.taken_s(frame(5000), 101.0)[0] == pytest.approx(100.5)
    times.hear(beacon(11, 100.55), 100.551)
    assert times.taken_s(frame(12), 101.0)[0] == pytest.approx(100.55)


@pytest.mark.parametrize("seed", range(10))
def test_whatever_is_told_before_the_true_beacon_makes_no_frame_younger(seed: int) -> None:
    """Beacons of the watched line: numbers that go up, times of any kind."""
    odd, times = random.Random(seed), FrameTimes(_CLOCK)
    for seq in range(200):
        now_s = 100 + 0.05 * seq
        if odd.random() < 0.3:
            told_s = odd.choice([0.0, now_s - 1, now_s, now_s + 1, 9e9])
            times.hear(beacon(seq + odd.randrange(3), told_s), now_s - 0.01)
        if odd.random() < 0.8:
            times.hear(beacon(seq, now_s), now_s + 0.001)
        taken_s, _ = times.taken_s(frame(seq), now_s + 0.002)
        assert taken_s is None or taken_s <= now_s + 1e-9


def test_memory_is_bounded() -> None:
    times = FrameTimes(_CLOCK)
    for seq in range(5000):
        times.hear(beacon(seq, 100 + seq), 100 + seq)
    assert len(times._seqs) <= 1024
    assert times.taken_s(frame(4999), 5100.0)[0] == 5099.0
