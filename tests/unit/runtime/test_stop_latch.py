"""What engages the emergency stop, and what releases it."""

from __future__ import annotations

import pytest

from heel.schemas import EStop
from heel.services.runtime.stop_latch import StopLatch

A, B = "a" * 16, "b" * 16


def stop(name: str = "", t_ns: int = 1) -> EStop:
    return EStop(engaged=True, source="a person", id=name, t_ns=t_ns)


def release(name: str = "", t_ns: int = 1) -> EStop:
    return EStop(engaged=False, source="a person", id=name, t_ns=t_ns)


def held(*messages: EStop) -> StopLatch:
    latch = StopLatch()
    for now_s, message in enumerate(messages):
        latch.hear(message, 10.0 * now_s)
    return latch


@pytest.mark.parametrize(
    ("messages", "engaged"),
    [
        ([], False),
        ([stop()], True),
        ([stop(A)], True),
        ([stop(), release()], False),
        ([stop(A), release(A)], False),
        ([stop(A), release(B)], True),
        ([stop(A), release()], True),
        ([stop(), release(A)], True),
        ([stop(t_ns=5), release(t_ns=4)], True),
        ([stop(t_ns=5), release(t_ns=5)], False),
        ([stop(A), stop(B), release(A)], True),
        ([stop(A), stop(B), release(B)], False),
        ([stop(A), stop(), release(A)], False),
        ([stop(), stop(A), release()], True),
        ([stop(A), release(A), stop(B), release(A)], True),
        ([stop(A), release(A), stop(B), stop(A), release(A)], True),
        ([stop(A), release(A), stop(A)], True),
        ([release(A), release(), stop(B)], True),
    ],
)
def test_a_release_ends_the_engagement_that_it_names(messages: list[EStop], engaged: bool) -> None:
    assert held(*messages).engaged == engaged


def test_only_changes_are_news() -> None:
    latch = StopLatch()
    assert latch.hear(stop(A), 1.0)
    assert not latch.hear(stop(A), 1.1)
    assert latch.hear(stop(B), 1.2), "another engagement"
    assert not latch.hear(release(A), 1.3)
    assert latch.hear(release(B), 1.4)
    assert not latch.hear(release(B), 1.5)


def test_who_asks_is_told_the_engagement_or_the_release_that_ended_it() -> None:
    assert held().told is None
    assert held(stop(A)).told == stop(A)
    assert held(stop(A), release(B)).told == stop(A)
    assert held(stop(A), release(A)).told == release(A)


def test_an_answer_engages_whoever_missed_the_stop() -> None:
    latch = StopLatch()
    assert latch.hear_answers([release(B), stop(A)], 1.0)
    assert latch.engaged


@pytest.mark.parametrize("order", [1, -1])
def test_an_answer_of_somebody_who_missed_the_release_engages_nobody(order: int) -> None:
    assert not StopLatch().hear_answers([stop(A), release(A)][::order], 1.0)
    latch = held(stop(A), release(A))
    assert not latch.hear_answers([stop(A)], 1000.0)
    assert not latch.engaged


def test_an_answer_releases_whoever_missed_that_release() -> None:
    latch = held(stop(A))
    assert not latch.hear_answers([release(B), release()], 20.0)
    assert latch.engaged
    assert latch.hear_answers([release(A)], 20.0)
    assert not latch.engaged


def test_an_answer_without_id_is_not_believed_just_around_a_release() -> None:
    latch = StopLatch()
    latch.hear(stop(), 10.0)
    latch.hear(release(), 20.0)
    assert not latch.hear_answers([stop()], 19.9)
    assert not latch.hear_answers([stop()], 22.0)
    assert latch.hear_answers([stop()], 24.0)


def test_what_an_earlier_process_left_behind_holds() -> None:
    latch = StopLatch()
    latch.restore(release(A))
    assert not latch.engaged
    latch.restore(stop(A))
    assert latch.engaged
    assert not latch.hear_answers([], 1.0), "nobody else knows"
    assert latch.engaged


def test_countless_releases_take_no_memory() -> None:
    latch = StopLatch()
    for number in range(1000):
        latch.hear(release(f"{number:016x}"), 1.0)
    latch.hear(stop(A), 2.0)
    assert latch.engaged
    assert len(latch._over) < 100
