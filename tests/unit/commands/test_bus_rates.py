"""Rates, gaps and ages from arrival times."""

from __future__ import annotations

import json

import pytest

from heel.services.commands.bus.message import Received, Told
from heel.services.commands.bus.rates import (
    BusRates,
    KeyRates,
    as_object,
    bw_line,
    bytes_text,
    hz_line,
)
from heel.services.commands.columns import aligned

KEY = "cam/front/tracks"


def told(seq: int, producer: str = "tracker/main@0123abcd", epoch: int = 1) -> Told:
    return Told("tracks", None, producer=producer, age_s=0.02, counted=(producer, epoch, seq))


def came(at_s: float, size: int = 1000, key: str = KEY) -> Received:
    return Received(key, at_s, size, "application/x-msgpack;tracks.v1", None, None)


def regular(count: int, period_s: float = 0.04) -> KeyRates:
    rates = KeyRates()
    for n in range(count):
        rates.hear(came(n * period_s), told(n))
    return rates


def test_a_regular_stream_has_its_rate_bandwidth_and_age() -> None:
    rates = regular(26)
    assert rates.rate_hz(1.0) == pytest.approx(25.0)
    assert rates.bytes_per_s(1.0) == pytest.approx(25_000.0)
    assert hz_line(KEY, rates, 1.0) == (
        f"{KEY}  25.0/s, every 40 ms (40 to 40), 20 ms old (at most 20), 0 missing"
    )
    assert bw_line(KEY, rates, 1.0) == f"{KEY}  25 kB/s, 1 kB each (at most 1 kB)"


def test_only_the_last_seconds_count() -> None:
    rates = regular(26)
    for n in range(26):
        rates.hear(came(10.0 + n * 0.1), told(30 + n))
    assert rates.rate_hz(12.5) == pytest.approx(10.0)
    assert rates.count == 52


def test_gaps_in_numbers_are_missing_messages_and_repeats_are_not() -> None:
    rates = KeyRates()
    for n, seq in enumerate((0, 1, 4, 3, 4, 5)):
        rates.hear(came(n * 0.1), told(seq))
    assert rates.missing == 2
    rates.hear(came(1.0), told(700, epoch=2))
    rates.hear(came(1.1), told(701, epoch=2))
    assert rates.missing == 2, "another epoch starts over"
    rates.hear(came(1.2), told(9000, producer="tracker/other@0123abcd"))
    assert rates.missing == 2
    assert "2 senders: tracker/main@0123abcd, tracker/other" in hz_line(KEY, rates, 1.2)


def test_a_stream_that_stops_is_silent_soon_and_one_that_is_slow_is_not() -> None:
    assert regular(26).silent_s(1.5) is None
    assert "silent for 2.0 s, 26 before" in hz_line(KEY, regular(26), 3.0)
    assert regular(5, period_s=1.0).silent_s(7.0) is None
    assert KeyRates().silent_s(5.0) is None


def test_one_message_has_no_rate() -> None:
    rates = regular(1)
    assert rates.rate_hz(0.0) == 0.0
    assert hz_line(KEY, rates, 0.1) == f"{KEY}  1 so far"
    assert as_object(KEY, rates, 0.1)["rate_hz"] == 0.0


def test_undecodable_messages_are_counted() -> None:
    rates = KeyRates()
    for n in range(3):
        rates.hear(came(n * 0.1), Told("?", None, "not msgpack"))
    assert "3 undecodable" in hz_line(KEY, rates, 0.2)
    assert json.loads(json.dumps(as_object(KEY, rates, 0.2)))["undecodable"] == 3


def test_messages_at_one_moment_have_no_infinite_rate() -> None:
    rates = KeyRates()
    for n in range(3):
        rates.hear(came(1.0), told(n))
    assert rates.rate_hz(1.0) == 0.0


def test_keys_are_bounded() -> None:
    bus = BusRates()
    for n in range(1000):
        bus.hear(came(1.0, key=f"a/{n}"))
    assert len(bus.keys) == 256
    assert bus.unlisted == 744
    assert [key for key, _ in bus.rows()] == sorted(bus.keys)


def test_sizes_are_in_units_of_a_thousand() -> None:
    sizes = (0, 999, 1000, 921_600, 5e9)
    assert [bytes_text(size) for size in sizes] == ["0 B", "999 B", "1 kB", "922 kB", "5 GB"]


def test_columns_are_as_wide_as_what_is_in_them() -> None:
    table = [("topic", "per s"), ("cam/front/tracks", "9.0"), ("a", "25.0")]
    assert aligned(table, right=frozenset({1})) == [
        "topic             per s",
        "cam/front/tracks    9.0",
        "a                  25.0",
    ]
