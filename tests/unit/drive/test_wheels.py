"""Drivers that fail, hang, or are left alone: the wheels stop, and it is said."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import pytest

from heel.services.drive.drivers import Driver, OdometryReading
from heel.services.drive.wheels import DriverError, Wheels
from tests.support.network import wait_until

READING = OdometryReading(1.0, 2.0, 0.5, 0.3, 0.1)


class FakeDriver(Driver):
    """Notes its calls; `trouble` is called within each `set_velocity` that moves."""

    def __init__(self, trouble: Callable[[], None] = lambda: None) -> None:
        self.calls: list[tuple[float, float] | str] = []
        self._trouble = trouble

    def set_velocity(self, linear_mps: float, angular_radps: float) -> None:
        self.calls.append((linear_mps, angular_radps))
        if linear_mps or angular_radps:
            self._trouble()

    def stop(self) -> None:
        self.calls.append("stop")

    def close(self) -> None:
        self.calls.append("close")

    def odometry(self) -> OdometryReading | None:
        return READING


def broken() -> None:
    raise OSError("no such board")


def look(wheels: Wheels, from_s: float, times: int) -> None:
    """As the service loop does, fifty times a second."""
    for turn in range(times):
        wheels.check(from_s + 0.02 * turn)


def failure_of(wheels: Wheels) -> str | None:
    try:
        wheels.check(time.monotonic())
    except DriverError as error:
        return str(error)
    return None


def test_orders_reach_the_driver_and_the_end_is_a_stop() -> None:
    driver = FakeDriver()
    wheels = Wheels(driver, deadline_s=5.0, silence_s=5.0)
    wheels.turn(0.5, 0.1)
    wait_until(lambda: (0.5, 0.1) in driver.calls, "the order")
    wait_until(lambda: wheels.odometry() == READING, "the odometry")
    assert wheels.finish()
    assert driver.calls == [(0.5, 0.1), "stop", "close"]


def test_zero_is_a_stop() -> None:
    driver = FakeDriver()
    wheels = Wheels(driver, deadline_s=5.0, silence_s=5.0)
    wheels.turn(0.0, 0.0)
    wait_until(lambda: bool(driver.calls), "the order")
    assert wheels.finish()
    assert set(driver.calls) == {"stop", "close"}


def test_wheels_that_are_given_no_orders_stop_by_themselves() -> None:
    driver = FakeDriver()
    wheels = Wheels(driver, deadline_s=5.0, silence_s=0.02)
    wheels.turn(0.5, 0.0)
    wait_until(lambda: driver.calls[-1:] == ["stop"], "the stop")
    assert wheels.finish()


def test_a_driver_that_raises_is_stopped_and_named() -> None:
    driver = FakeDriver(broken)
    wheels = Wheels(driver, deadline_s=5.0, silence_s=5.0)

    wheels.turn(0.5, 0.0)
    wait_until(lambda: failure_of(wheels) is not None, "the failure")
    assert "driver failed: OSError: no such board" in str(failure_of(wheels))
    assert wheels.finish(), "it did stop"
    assert driver.calls == [(0.5, 0.0), "stop", "close"]


def test_a_driver_that_hangs_is_noticed_and_a_last_stop_is_tried() -> None:
    release = threading.Event()

    def hang() -> None:
        release.wait(20.0)

    driver = FakeDriver(hang)
    wheels = Wheels(driver, deadline_s=0.05, silence_s=5.0)
    try:
        wheels.turn(0.5, 0.0)
        wait_until(lambda: bool(driver.calls), "the order")
        now_s = time.monotonic()
        with pytest.raises(DriverError, match=r"one call takes longer than 0\.05 s"):
            look(wheels, now_s, 5)
        started_s = time.monotonic()
        assert wheels.finish(), "the other thread got through"
        assert time.monotonic() - started_s < 5.0
        assert driver.calls == [(0.5, 0.0), "stop"]
    finally:
        release.set()


def test_a_process_that_was_held_up_itself_accuses_no_driver() -> None:
    """A machine too busy to run it: the call went no further because nothing did."""
    release = threading.Event()
    driver = FakeDriver(lambda: bool(release.wait(20.0)) and None)
    wheels = Wheels(driver, deadline_s=0.3, silence_s=5.0)
    try:
        wheels.turn(0.5, 0.0)
        wait_until(lambda: bool(driver.calls), "the order")
        now_s = time.monotonic()
        wheels.check(now_s)
        wheels.check(now_s + 5.0)
        wheels.check(now_s + 5.02)
        with pytest.raises(DriverError, match="driver hangs"):
            look(wheels, now_s + 5.04, 20)
    finally:
        release.set()
    assert wheels.finish()


def test_wheels_that_cannot_be_stopped_are_no_secret() -> None:
    release = threading.Event()

    class Stuck(FakeDriver):
        def stop(self) -> None:
            release.wait(20.0)

    wheels = Wheels(Stuck(), deadline_s=0.05, silence_s=5.0)
    try:
        started_s = time.monotonic()
        assert not wheels.finish()
        assert time.monotonic() - started_s < 5.0
    finally:
        release.set()
