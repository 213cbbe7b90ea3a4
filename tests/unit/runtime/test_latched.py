"""Asking for latched values: answers come, and silence holds nobody up."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
import zenoh

from heel.schemas import EStop, MessageError, encode
from heel.services.runtime import latched, qos
from heel.services.runtime.asking import Question
from heel.services.runtime.latched import LatchedAnswers, LatchedQuery, latched_values
from heel.services.runtime.publishing import Latched
from tests.support.network import DEADLINE_S, wait_until

LOG = logging.getLogger("test-latched")
STOP = EStop(engaged=True, source="somebody")


@contextmanager
def answering(
    session: zenoh.Session, key: str, answer: Callable[[zenoh.Query], None]
) -> Iterator[None]:
    queryable = session.declare_queryable(key, answer)
    try:
        yield
    finally:
        queryable.undeclare()


@contextmanager
def silence(session: zenoh.Session, key: str) -> Iterator[threading.Event]:
    """Something that takes questions and neither answers nor ends them; set once it has one."""
    asked, kept = threading.Event(), []

    def keep(query: zenoh.Query) -> None:
        kept.append(query)
        asked.set()

    with answering(session, key, keep):
        yield asked


def nonsense(query: zenoh.Query) -> None:
    """Answer with what is no message."""
    with query:
        query.reply(query.key_expr, b"what is this")


def reach(session: zenoh.Session, key: str) -> None:
    """Wait until questions of this session get to where the key is served."""
    querier = session.declare_querier(key)
    wait_until(lambda: bool(querier.matching_status.matching), f"{key} served")
    querier.undeclare()


def test_asked_once_all_values_come(sender: zenoh.Session, receiver: zenoh.Session) -> None:
    with Latched(sender, "latched/once", qos.ESTOP) as value:
        value.set(STOP)
        reach(receiver, "latched/once")
        found = latched_values(receiver, "latched/once", EStop, LOG, threading.Event())
        assert list(found) == [STOP]


def test_everybody_who_holds_a_value_is_heard(
    sender: zenoh.Session, receiver: zenoh.Session
) -> None:
    """By default Zenoh passes on the last answer of a key alone: the stop might be another's."""
    release = EStop(engaged=False, source="somebody else", id="1" * 16)
    with (
        Latched(sender, "latched/both", qos.ESTOP) as one,
        Latched(receiver, "latched/both", qos.ESTOP) as other,
    ):
        one.set(STOP)
        other.set(release)
        reach(receiver, "latched/both")
        found = latched_values(receiver, "latched/both", EStop, LOG, threading.Event())
        assert sorted(answer.source for answer in found) == [STOP.source, release.source]


def test_a_flood_of_answers_is_bounded(sender: zenoh.Session, receiver: zenoh.Session) -> None:
    def flood(query: zenoh.Query) -> None:
        with query:
            for _ in range(500):
                query.reply(query.key_expr, encode(STOP), encoding=EStop.encoding())

    with answering(sender, "latched/flood", flood):
        reach(receiver, "latched/flood")
        question = Question(receiver, "latched/flood", DEADLINE_S)
        wait_until(question._ended.is_set, "the last answer")
        assert 0 < len(list(question.replies())) <= 16
        assert question.over


def test_asked_once_what_is_no_such_message_is_logged_and_the_rest_comes(
    sender: zenoh.Session, receiver: zenoh.Session, caplog: pytest.LogCaptureFixture
) -> None:
    with (
        answering(sender, "latched/odd/a", nonsense),
        Latched(sender, "latched/odd/b", qos.ESTOP) as value,
    ):
        value.set(STOP)
        reach(receiver, "latched/odd/a")
        reach(receiver, "latched/odd/b")
        found = latched_values(receiver, "latched/odd/*", EStop, LOG, threading.Event())
        assert list(found) == [STOP]
    assert "latched/odd" in caplog.text


def test_asked_once_a_stop_ends_the_wait_for_an_answer(
    sender: zenoh.Session, receiver: zenoh.Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(latched, "_LONGEST_S", 4 * DEADLINE_S)
    stop, found = threading.Event(), []
    with silence(sender, "latched/silent") as asked:
        reach(receiver, "latched/silent")
        values = latched_values(receiver, "latched/silent", EStop, LOG, stop)
        waiting = threading.Thread(target=lambda: found.extend(values), daemon=True)
        waiting.start()
        assert asked.wait(DEADLINE_S)
        assert waiting.is_alive()
        stop.set()
        waiting.join(DEADLINE_S)
        assert not waiting.is_alive()
    assert found == []


def test_asked_once_silence_ends_by_itself(sender: zenoh.Session, receiver: zenoh.Session) -> None:
    with silence(sender, "latched/mute"):
        reach(receiver, "latched/mute")
        values = latched_values(receiver, "latched/mute", EStop, LOG, threading.Event())
        assert list(values) == []


def test_a_query_asks_anew_until_somebody_answers(
    sender: zenoh.Session, receiver: zenoh.Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(latched, "_PERIOD_S", 0.2)
    query = LatchedQuery(receiver, "latched/query", EStop)
    assert query.poll(time.monotonic()) is None
    found: list[EStop] = []

    def answered() -> bool:
        if (answer := query.poll(time.monotonic())) is not None:
            found.append(answer)
        return bool(found)

    with Latched(sender, "latched/query", qos.ESTOP) as value:
        value.set(STOP)
        wait_until(answered, "the answer")
    assert found == [STOP]


def test_a_query_says_that_an_answer_cannot_be_read(
    sender: zenoh.Session, receiver: zenoh.Session
) -> None:
    def refused() -> bool:
        try:
            question.poll(0.0)
        except MessageError:
            return True
        return False

    with answering(sender, "latched/bad", nonsense):
        reach(receiver, "latched/bad")
        question = LatchedQuery(receiver, "latched/bad", EStop)
        wait_until(refused, "the refusal")


def test_the_answers_of_all_come_together(sender: zenoh.Session, receiver: zenoh.Session) -> None:
    other = EStop(engaged=False, source="another")
    with (
        Latched(sender, "latched/all/a", qos.ESTOP) as first,
        Latched(sender, "latched/all/b", qos.ESTOP) as second,
    ):
        first.set(STOP)
        second.set(other)
        reach(receiver, "latched/all/a")
        reach(receiver, "latched/all/b")
        question = LatchedAnswers(receiver, "latched/all/*", EStop, 60.0)
        found: list[list[EStop]] = []

        def answered() -> bool:
            answers = question.poll(0.0)
            if answers is not None:
                found.append(answers)
            return bool(found)

        wait_until(answered, "all answers")
    assert sorted(found[0], key=lambda stop: stop.engaged) == [other, STOP]
    assert question.asked_s == 0.0
