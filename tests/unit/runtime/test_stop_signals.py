"""SIGTERM and Ctrl-C ask a process to end; if it does not, it is ended."""

from __future__ import annotations

import signal
import threading
from pathlib import Path

import pytest

from heel.services.runtime.stop_signals import stop_signals
from tests.support.network import wait_until
from tests.support.processes import running

_WELL_BEHAVED = """
from heel.services.runtime.stop_signals import stop_signals
with stop_signals() as stop:
    print("ready", flush=True)
    raise SystemExit(0 if stop.wait(30) else 9)
"""
_HUNG = """
import threading
from heel.services.runtime.stop_signals import stop_signals
with stop_signals(0.3) as stop:
    print("ready", flush=True)
    while True:
        threading.Event().wait(30)
"""
_WITHIN_THE_EVENT = """
import os, signal, time
from heel.services.runtime.stop_signals import stop_signals
with stop_signals(5.0) as stop:
    print("ready", flush=True)
    while not os.path.exists(SENT):
        # What `Event.wait` holds on its way in and out; the signal comes in here.
        with stop._cond:
            time.sleep(0.5)
    raise SystemExit(0 if stop.wait(5) else 9)
"""
_WITHIN_NATIVE_CODE = """
import ctypes
from heel.services.runtime.stop_signals import stop_signals
mutex = ctypes.create_string_buffer(64)
with stop_signals(0.3) as stop:
    print("ready", flush=True)
    # Locked twice by one thread, it is waited for without end; no signal interrupts that.
    ctypes.CDLL(None).pthread_mutex_lock(mutex)
    ctypes.CDLL(None).pthread_mutex_lock(mutex)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_sets_the_event_and_the_process_ends_by_itself(number: signal.Signals) -> None:
    with running("-c", _WELL_BEHAVED) as process:
        wait_until(lambda: "ready" in process.stdout(), "the process")
        code, took_s = process.stop(number, 10.0)
        assert (code, process.stderr()) == (0, "")
        assert took_s < 1.5


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_hung_process_is_ended_by_force_and_says_where_it_hung(number: signal.Signals) -> None:
    with running("-c", _HUNG) as process:
        wait_until(lambda: "ready" in process.stdout(), "the process")
        code, _ = process.stop(number, 10.0)
        assert code == 1
        assert "forced exit" in process.stderr()
        assert "most recent call first" in process.stderr()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_in_the_middle_of_a_wait_does_not_hang(
    number: signal.Signals, tmp_path: Path
) -> None:
    sent = tmp_path / "sent"
    with running("-c", f"SENT = {str(sent)!r}" + _WITHIN_THE_EVENT) as process:
        wait_until(lambda: "ready" in process.stdout(), "the process")
        process.process.send_signal(number)
        sent.touch()
        assert process.wait(10.0) == 0, process.stderr()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_process_stuck_in_native_code_is_ended_by_force(number: signal.Signals) -> None:
    with running("-c", _WITHIN_NATIVE_CODE) as process:
        wait_until(lambda: "ready" in process.stdout(), "the process")
        code, _ = process.stop(number, 10.0)
        assert code == 1
        assert "forced exit" in process.stderr()


def test_further_signals_change_nothing() -> None:
    with running("-c", _WELL_BEHAVED) as process:
        wait_until(lambda: "ready" in process.stdout(), "the process")
        process.process.send_signal(signal.SIGINT)
        code, _ = process.stop(signal.SIGINT, 10.0)
        assert code == 0


def test_handlers_of_the_caller_come_back() -> None:
    before = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)
    with stop_signals() as stop:
        assert isinstance(stop, threading.Event)
        assert signal.getsignal(signal.SIGTERM) is not before[0]
    assert (signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)) == before
