"""Counters, and the health that a service reports of itself."""

from __future__ import annotations

import datetime
import logging
import queue
import threading
import time
from typing import Any, cast

import pytest

from heel.schemas import Health, decode, encode
from heel.schemas.base import MAX_AGE_NS
from heel.services.runtime.counters import ServiceStatistics
from heel.services.runtime.health import HUNG_S, START_S, HealthReporter
from tests.support.arrivals import PRODUCER
from tests.support.network import DEADLINE_S


class FakeSession:
    """Keeps what is published."""

    def __init__(self) -> None:
        self.sent: queue.Queue[tuple[bytes, str]] = queue.Queue()

    def declare_publisher(self, _key: str, **_: object) -> FakeSession:
        """The publisher is the session itself."""
        return self

    def put(self, payload: bytes, encoding: str) -> None:
        """Keep one message."""
        self.sent.put((payload, encoding))


@pytest.fixture
def statistics() -> ServiceStatistics:
    return ServiceStatistics()


@pytest.fixture
def session() -> FakeSession:
    return FakeSession()


@pytest.fixture
def reporter(statistics: ServiceStatistics, session: FakeSession) -> HealthReporter:
    log = logging.getLogger("heel.test")
    return HealthReporter(cast(Any, session), "tracker", "main", PRODUCER, statistics, log)


def test_rates_are_of_the_last_two_seconds(statistics: ServiceStatistics) -> None:
    for step in range(100):
        statistics.input(step * 0.04)
        if step % 2:
            statistics.output(step * 0.04, 0.001, 0.0)
    assert statistics.rates_hz(3.96) == pytest.approx((25.0, 12.5), abs=0.6)
    assert statistics.rates_hz(60.0) == (0.0, 0.0)
    assert (statistics.received, statistics.sent) == (100, 50)


def test_percentiles_are_of_the_last_256_results(statistics: ServiceStatistics) -> None:
    assert statistics.busy_and_age_ms() == ((0.0,) * 3, (0.0,) * 3)
    for step in range(1000):
        statistics.output(0.0, 1.0 if step < 700 else 0.010, 0.020)
    busy_ms, age_ms = statistics.busy_and_age_ms()
    assert busy_ms == pytest.approx((10.0,) * 3)
    assert age_ms == pytest.approx((20.0,) * 3)


def test_problems_are_news_when_they_come_change_and_go(statistics: ServiceStatistics) -> None:
    assert not statistics.problem("camera", None)
    assert statistics.problem("camera", "silent")
    assert not statistics.problem("camera", "silent")
    assert statistics.problem("camera", "frozen")
    assert statistics.problems() == ["frozen"]
    assert statistics.problem("camera", None)
    assert statistics.problems() == []


def test_health_starts_becomes_ok_and_ends(
    reporter: HealthReporter, statistics: ServiceStatistics
) -> None:
    now_s = time.monotonic()
    assert reporter.compose(now_s).state == "starting"
    statistics.loop(now_s)
    statistics.input(now_s)
    health = reporter.compose(now_s + 0.5)
    assert (health.state, health.reason) == ("ok", "")
    assert health.input_age_s == pytest.approx(0.5)
    assert health.loop_age_s == pytest.approx(0.5)
    assert health.producer == PRODUCER
    assert health.rss_mb > 1
    assert reporter.compose(now_s, ended=True).state == "ended"


def test_problems_degrade_health_and_are_all_named(
    reporter: HealthReporter, statistics: ServiceStatistics
) -> None:
    statistics.loop(time.monotonic())
    statistics.problem("a", "camera silent")
    statistics.problem("b", "two producers")
    health = reporter.compose(time.monotonic())
    assert (health.state, health.reason) == ("degraded", "camera silent; two producers")


@pytest.mark.parametrize(("ever_looped", "limit_s"), [(True, HUNG_S), (False, START_S)])
def test_a_hung_loop_is_an_error_that_says_for_how_long(
    ever_looped: bool, limit_s: float, reporter: HealthReporter, statistics: ServiceStatistics
) -> None:
    now_s = time.monotonic()
    if ever_looped:
        statistics.loop(now_s)
    assert reporter.compose(now_s + limit_s - 0.5).state == ("ok" if ever_looped else "starting")
    health = reporter.compose(now_s + limit_s + 1.0)
    assert health.state == "error"
    assert f"loop has hung for {limit_s + 1.0:.1f} s: restart it" in health.reason


def test_health_is_valid_whatever_was_measured(
    reporter: HealthReporter, statistics: ServiceStatistics
) -> None:
    """A thread that dies of a value would leave the service without health."""
    now_s = time.monotonic()
    statistics.loop(now_s)
    for number in range(100):
        statistics.problem(f"kind {number}", "a long reason " * 100)
    statistics.output(now_s, 1e6, MAX_AGE_NS * 1e-9 + 1e6)
    statistics.output(now_s, -1.0, -1.0)
    statistics.dropped = 2**63 - 1
    statistics.input(now_s + 100.0)
    health = reporter.compose(now_s)
    assert decode(Health, encode(health)) == health
    assert len(health.reason) == 512


def test_the_reporter_sends_by_itself_and_ends_with_a_last_message(
    reporter: HealthReporter, statistics: ServiceStatistics, session: FakeSession,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr("heel.services.runtime.health.PERIOD_S", 0.01)
    statistics.loop(time.monotonic())
    reporter.start()
    payload, encoding = session.sent.get(timeout=DEADLINE_S)
    assert decode(Health, payload, encoding).state == "ok"
    reporter.finish()
    assert not reporter.is_alive()
    states = []
    while not session.sent.empty():
        states.append(decode(Health, *session.sent.get_nowait()).state)
    assert states[-1] == "ended"
    assert reporter not in threading.enumerate()


def test_changes_of_health_are_logged_once(
    reporter: HealthReporter, statistics: ServiceStatistics, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    statistics.loop(time.monotonic())
    for reason in (None, None, "camera silent", "camera silent", None):
        statistics.problem("camera", reason)
        reporter._send(reporter.compose(time.monotonic()))
    assert [line.strip() for line in caplog.messages] == [
        "health: starting -> ok", "health: ok -> degraded camera silent", "health: degraded -> ok",
    ]  # fmt: skip


class FakePresence:
    """As the test says."""

    away = False
    gone: tuple[str, ...] = ()

    def bus_away(self, _now_s: float) -> bool:
        return self.away

    def missing(self, _now_s: float) -> list[str]:
        return list(self.gone)


def test_a_service_knows_that_the_router_is_away_and_that_a_neighbour_is_gone(
    statistics: ServiceStatistics, session: FakeSession
) -> None:
    presence = FakePresence()
    reporter = HealthReporter(
        cast(Any, session), "tracker", "main", PRODUCER, statistics,
        logging.getLogger("heel.test"), None, cast(Any, presence),
    )  # fmt: skip
    now_s = time.monotonic()
    statistics.loop(now_s)
    assert reporter.compose(now_s + 0.1).state == "ok"
    presence.away = True
    assert (reporter.compose(now_s + 0.1).state, reporter.compose(now_s + 0.1).reason) == (
        "degraded", "the router is away",
    )  # fmt: skip
    presence.away, presence.gone = False, ("follower", "drive")
    health = reporter.compose(now_s + 0.1)
    assert health.reason == "follower: gone"
    assert health.details["missing"] == "follower,drive"
    presence.gone = ()
    assert (reporter.compose(now_s + 0.1).state, reporter.compose(now_s + 0.1).details) == (
        "ok",
        {},
    )


def test_an_input_that_falls_silent_is_a_problem_until_it_comes_again(
    statistics: ServiceStatistics, reporter: HealthReporter
) -> None:
    now_s = time.monotonic()
    statistics.input_topic = "blobs"
    statistics.loop(now_s)
    assert reporter.compose(now_s).state == "ok", "nothing was there to be missed"
    for frame in range(10):
        statistics.input(now_s + frame * 0.04)
    assert reporter.compose(now_s + 0.8).state == "ok"
    assert reporter.compose(now_s + 1.4).reason == "no blobs for 1 s: is detector running?"
    statistics.input(now_s + 1.5)
    assert reporter.compose(now_s + 1.6).state == "ok"


def test_a_slow_input_and_one_that_has_ended_are_not_missed(
    statistics: ServiceStatistics, reporter: HealthReporter
) -> None:
    now_s = time.monotonic()
    statistics.input_topic = "image"
    for frame in range(4):
        statistics.input(now_s + frame)
    statistics.loop(now_s + 5.0)
    assert reporter.compose(now_s + 5.5).reason == ""
    statistics.input_over = True
    assert reporter.compose(now_s + 6.9).reason == ""


@pytest.mark.parametrize(
    ("days", "words"),
    [(29.0, "certificate ends in 29 days"), (-2.0, "certificate ended 2 days ago"), (31.0, None)],
)
def test_a_certificate_is_told_of_a_month_before_it_ends(
    statistics: ServiceStatistics, session: FakeSession, days: float, words: str | None
) -> None:
    until = datetime.datetime.now(datetime.UTC) + datetime.timedelta(days=days)
    reporter = HealthReporter(
        cast(Any, session), "tracker", "main", PRODUCER, statistics, logging.getLogger("heel.test"),
        certificate_until=until,
    )  # fmt: skip
    statistics.loop(time.monotonic())
    health = reporter.compose(time.monotonic())
    told = health.details.get("certificate")
    assert (told is None) if words is None else (told is not None and told.startswith(words))
    assert health.state == "ok", "it still works"
