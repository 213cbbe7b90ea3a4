"""Attempts to log in, and sessions: pure, on a clock of the test."""

from __future__ import annotations

from heel.services.web.login import IDLE_S, LONGEST_S, Attempts, Sessions


def fail(attempts: Attempts, times: int, now_s: float, address: str = "a", user: str = "u") -> None:
    for _ in range(times):
        attempts.failed(address, user, now_s)


def test_a_few_wrong_passwords_are_free_and_then_one_every_twelve_seconds() -> None:
    attempts = Attempts()
    fail(attempts, 4, 0.0)
    assert attempts.wait_s("a", "u", 0.0) == 0.0
    fail(attempts, 1, 0.0)
    assert attempts.wait_s("a", "u", 0.0) == 12.0
    assert attempts.wait_s("a", "u", 12.0) == 0.0
    fail(attempts, 1, 12.0)
    assert attempts.wait_s("a", "u", 12.0) == 12.0
    assert attempts.wait_s("a", "u", 1000.0) == 0.0


def test_many_addresses_share_the_attempts_for_one_name_and_many_names_those_of_one_address() -> (
    None
):
    attempts = Attempts()
    for number in range(5):
        attempts.failed(f"10.0.0.{number}", "anna", 0.0)
        attempts.failed("10.0.1.1", f"user-{number}", 0.0)
    assert attempts.wait_s("10.0.0.99", "anna", 0.0) > 0
    assert attempts.wait_s("10.0.1.1", "ben", 0.0) > 0
    assert attempts.wait_s("10.0.0.99", "ben", 0.0) == 0.0


def test_one_network_of_ipv6_is_one_address() -> None:
    attempts = Attempts()
    for number in range(5):
        attempts.failed(f"2001:db8::{number}", f"user-{number}", 0.0)
    assert attempts.wait_s("2001:db8::ffff", "anna", 0.0) > 0
    assert attempts.wait_s("2001:db8:0:1::1", "anna", 0.0) == 0.0


def test_the_right_password_costs_nothing() -> None:
    attempts = Attempts()
    for _ in range(20):
        fail(attempts, 1, 0.0)
        attempts.right("a", "u")
    assert attempts.wait_s("a", "u", 0.0) == 0.0


def test_attempts_of_many_addresses_take_bounded_memory() -> None:
    attempts = Attempts()
    for number in range(20_000):
        attempts.failed(f"10.{number >> 16}.{number >> 8 & 255}.{number & 255}", f"u{number}", 0.0)
    assert len(attempts._full_s) == 4096


def test_a_session_ends_when_it_is_not_used_when_it_is_old_and_when_it_is_ended() -> None:
    sessions = Sessions()
    idle, used, ended = (sessions.begin("anna", "operate", 0.0) for _ in range(3))
    sessions.end(ended)
    assert sessions.find(ended, 0.0) is None
    assert sessions.find(None, 0.0) is None
    assert sessions.find("guess", 0.0) is None
    now_s = 0.0
    while now_s < LONGEST_S:
        found = sessions.find(used, now_s)
        assert found is not None
        assert found.role == "operate"
        now_s += IDLE_S / 2
    assert sessions.find(used, LONGEST_S + 1.0) is None
    assert sessions.find(idle, IDLE_S + 1.0) is None


def test_many_sessions_take_bounded_memory_and_the_one_in_use_stays() -> None:
    sessions = Sessions()
    mine = sessions.begin("anna", "operate", 0.0)
    for number in range(1000):
        sessions.begin("ben", "watch", float(number))
        assert sessions.find(mine, float(number)) is not None
