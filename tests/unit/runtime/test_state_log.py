"""State changes are logged; one that flickers fills no log, and what lasts is told in the end."""

from __future__ import annotations

import logging

import pytest

from heel.services.runtime.logs import StateLog


def told(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records]


@pytest.fixture
def log(caplog: pytest.LogCaptureFixture) -> StateLog:
    caplog.set_level(logging.INFO, "heel.state-log")
    return StateLog(logging.getLogger("heel.state-log"))


def test_changes_are_told_at_once_and_once(log: StateLog, caplog: pytest.LogCaptureFixture) -> None:
    for turn, words in enumerate(["idle", "idle", "following", "following", "lost", "idle"]):
        log.tell(words, turn * 0.02)
    assert told(caplog) == ["idle", "following", "lost", "idle"]


def test_a_flickering_state_is_told_once_a_second(
    log: StateLog, caplog: pytest.LogCaptureFixture
) -> None:
    for turn in range(50 * 60):
        log.tell(f"stopped: {turn % 7}", turn * 0.02)
    assert 55 <= len(told(caplog)) <= 70


def test_what_lasts_is_told_in_the_end(log: StateLog, caplog: pytest.LogCaptureFixture) -> None:
    for turn in range(200):
        log.tell(f"stopped: {turn}", turn * 0.001)
    assert "driving" not in told(caplog)
    for turn in range(200):
        log.tell("driving", 0.2 + turn * 0.02)
    assert told(caplog)[-1] == "driving"
    assert told(caplog).count("driving") == 1
