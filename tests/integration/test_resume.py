"""`heel resume` against a drive: what it releases, and what it must not."""

from __future__ import annotations

import secrets
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import zenoh

from heel.schemas import EStop, decode, encode, keys
from heel.services.runtime.asking import EVERYBODY
from tests.support import network
from tests.support.driving import Robot, drive_process
from tests.support.network import wait_until
from tests.support.processes import Running, running

_BEFORE_S = 0.2
"""From a stop to a resume that is typed later without doubt: the kernel tells when a process was
started in steps of 10 ms, and what is that near counts as after it."""


@pytest.fixture
def endpoint() -> Iterator[str]:
    with network.router() as address:
        yield address


@pytest.fixture
def session(endpoint: str) -> Iterator[zenoh.Session]:
    with network.client(endpoint) as client:
        yield client


@pytest.fixture
def robot(endpoint: str, session: zenoh.Session) -> Iterator[Robot]:
    with drive_process(endpoint, session) as made:
        wait_until(lambda: made.newest is not None, "the drive", 30.0)
        yield made


def press(session: zenoh.Session) -> None:
    """STOP by a button on the bus, as a user's own program sends it; holds from now on."""
    estop = EStop(engaged=True, source="button", id=secrets.token_hex(8))
    session.put(keys.FOLLOW_ESTOP, encode(estop), encoding=EStop.encoding())
    wait_until(lambda: held(session) == estop.id, "the stop")


def held(session: zenoh.Session) -> str | None:
    """Id of the engagement that somebody answers for."""
    for reply in session.get(keys.FOLLOW_ESTOP, target=EVERYBODY, timeout=1.0):
        if reply.ok is not None:
            told = decode(EStop, reply.ok.payload.to_bytes(), str(reply.ok.encoding))
            return told.id if told.engaged else None
    return None


@contextmanager
def resuming(endpoint: str) -> Iterator[Running]:
    words = ("-m", "heel", "resume", "--without-follower", "--connect", endpoint)
    with running(*words) as process:
        yield process


def resume(endpoint: str) -> tuple[int, str]:
    with resuming(endpoint) as process:
        return process.wait(30.0), process.stdout() + process.stderr()


@pytest.mark.parametrize("stopped_before", [False, True])
def test_a_stop_that_was_pressed_after_resume_was_typed_stays(
    robot: Robot, session: zenoh.Session, endpoint: str, stopped_before: bool
) -> None:
    if stopped_before:
        press(session)
    with resuming(endpoint) as typed:
        press(session)
        code = typed.wait(30.0)
        assert code == 1, typed.stdout()
        assert "STOP was pressed after this was typed" in typed.stderr()
    assert robot.stopped
    assert resume(endpoint) == (0, "resumed\n")
    wait_until(lambda: not robot.stopped, "the release")


def test_a_resume_that_was_held_up_releases_no_stop_of_meanwhile(
    robot: Robot, session: zenoh.Session, endpoint: str
) -> None:
    press(session)
    with resuming(endpoint) as typed:
        # Before it has asked anybody: a process takes longer to import.
        typed.process.send_signal(signal.SIGSTOP)
        press(session)
        typed.process.send_signal(signal.SIGCONT)
        assert typed.wait(30.0) == 1, typed.stdout()
    assert robot.stopped


def test_a_program_that_answers_for_everything_and_hangs_silences_nobody(
    robot: Robot, session: zenoh.Session, endpoint: str
) -> None:
    kept: list[zenoh.Query] = []
    with network.client(endpoint) as other:
        swallowing = other.declare_queryable("**", kept.append, complete=True)
        press(session)
        time.sleep(_BEFORE_S)
        assert resume(endpoint) == (0, "resumed\n")
        wait_until(lambda: not robot.stopped, "the release")
        assert kept, "it was asked, too"
        swallowing.undeclare()
