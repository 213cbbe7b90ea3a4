"""How late a picture is, told by when it and those before it arrived."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import pytest

from heel.services.capture.arrivals import CountedArrivals, StampedArrivals

PERIOD_S = 0.05
Judge = Callable[[Iterable[tuple[float, float]]], list[tuple[float, float]]]


def through_a_stall(
    stall_s: float, drain_s: float = 0.002, jitter_s: float = 0.0, drop: bool = False
) -> list[tuple[float, float]]:
    """When pictures are taken and when they arrive; all that is taken in a stall arrives after it.

    Args:
        stall_s: how long nothing arrives, from 3 s on.
        drain_s: time between two pictures of the heap.
        jitter_s: largest delay of any picture.
        drop: the camera takes no pictures during the stall.
    """
    rng = np.random.default_rng(5)
    arrivals, last_s = [], 0.0
    for taken_s in np.arange(0.0, 12.0, PERIOD_S):
        arrived_s = float(taken_s) + jitter_s * rng.random()
        if 3.0 < taken_s <= 3.0 + stall_s:
            if drop:
                continue
            arrived_s = 3.0 + stall_s
        last_s = max(arrived_s, last_s + drain_s)
        arrivals.append((float(taken_s), last_s))
    return arrivals


def counted(arrivals: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """True lateness beside the judged one, seconds."""
    judge = CountedArrivals()
    return [(at_s - taken_s, judge.late_s(at_s)) for taken_s, at_s in arrivals]


def stamped(arrivals: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    judge = StampedArrivals()
    return [(at_s - taken_s, judge.late_s(at_s, 900.0 + taken_s)) for taken_s, at_s in arrivals]


@pytest.mark.parametrize("judge", [counted, stamped])
@pytest.mark.parametrize("stall_s", [0.3, 0.5, 1.0, 2.0, 8.0])
@pytest.mark.parametrize("drain_s", [0.0005, 0.01, 0.03])
@pytest.mark.parametrize("jitter_s", [0.0, 0.02, 0.06])
def test_what_waited_through_a_stall_is_as_old_as_it_is(
    judge: Judge, stall_s: float, drain_s: float, jitter_s: float
) -> None:
    both = np.array(judge(through_a_stall(stall_s, drain_s, jitter_s)))
    assert np.all(both[:, 1] > both[:, 0] - 0.2), "an old picture passes for a newer one"
    assert np.all(both[:, 1] < both[:, 0] + 0.2), "a new picture passes for an older one"


@pytest.mark.parametrize("judge", [counted, stamped])
def test_a_camera_that_paused_is_new_again_after_some_pictures(
    judge: Judge,
) -> None:
    both = np.array(judge(through_a_stall(2.0, drop=True)))
    after = np.flatnonzero(both[:, 1] > 0.2)
    assert len(after) <= 5, "the first pictures may be doubted, the others not"
    assert both[-100:, 1].max() < 0.05


@pytest.mark.parametrize("periods_s", [(0.04, 0.2), (0.04, 0.08), (0.2, 0.04), (0.1, 5.0)])
def test_another_rate_is_no_stall(periods_s: tuple[float, float]) -> None:
    times_s = np.cumsum([periods_s[0]] * 60 + [periods_s[1]] * 60)
    late_s = [late for _, late in counted((float(t), float(t)) for t in times_s)]
    assert max(late_s[:60]) < 0.05
    assert max(late_s[-50:]) < 0.05


def test_pictures_that_come_in_pairs_are_new() -> None:
    times_s = [pair * 0.08 + offset for pair in range(60) for offset in (0.0, 0.001)]
    assert max(late for _, late in counted((t, t) for t in times_s)) < 0.1


def test_a_link_that_slows_down_shows_in_time_stamps() -> None:
    """No pause and no heap: each picture arrives a little later than the one before."""
    arrivals = [(t, t * 1.05) for t in np.arange(0.0, 20.0, PERIOD_S)]
    both = np.array(stamped((float(a), float(b)) for a, b in arrivals))
    assert both[-1, 0] == pytest.approx(1.0, abs=0.05)
    assert both[-1, 1] == pytest.approx(both[-1, 0], abs=0.1)


@pytest.mark.parametrize("leap_s", [-1000.0, -0.5, 3600.0, 95443.7])
def test_time_stamps_that_start_anew_are_no_lateness(leap_s: float) -> None:
    judge = StampedArrivals()
    late_s = []
    for at_s in np.arange(0.0, 10.0, PERIOD_S):
        stamp_s = 5000.0 + float(at_s) + (leap_s if at_s > 5.0 else 0.0)
        late_s.append(judge.late_s(float(at_s), stamp_s))
    assert max(late_s) < 0.01


def test_a_clock_that_runs_slow_is_followed() -> None:
    judge = StampedArrivals()
    late_s = [judge.late_s(float(t), float(t) * 0.9999) for t in np.arange(0.0, 3600.0, 1.0)]
    assert max(late_s) < 0.01


def test_what_a_server_had_kept_is_not_the_newest() -> None:
    """The last key frame and what followed it, all at once, then the camera's own pace."""
    judge = StampedArrivals()
    joined = []
    for count in range(60):
        at_s = count * 0.001 if count < 40 else (count - 39) * PERIOD_S + 0.04
        judge.late_s(at_s, count * PERIOD_S)
        joined.append(judge.joined)
    assert not any(joined[:40])
    assert all(joined[40:])
