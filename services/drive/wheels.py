"""The driver in a thread of its own, so that a driver that hangs is noticed instead of waited for.

service loop ──newest order──▶ wheels thread ──▶ driver
     ▲                              │
     └── failure, odometry ─────────┘
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from heel.schemas.errors import HeelError
from heel.services.drive.drivers import Driver, OdometryReading

_LONGEST_GAP_S = 0.1
"""Longest time [s] between two looks at the driver that counts as time in which it was slow: five
rounds of the service loop. What is longer held up the whole process; chosen by hand."""


class DriverError(HeelError):
    """The driver raised or hangs: the wheels cannot be trusted to stop."""


@dataclass(frozen=True, slots=True)
class _Order:
    linear_mps: float = 0.0
    angular_radps: float = 0.0
    last: bool = False


_STOP, _END = _Order(), _Order(last=True)


class Wheels:
    """Hands the newest velocity to a driver and watches whether the driver keeps up.

    The thread stops the wheels by itself when no order comes for `silence_s`, so that a service
    loop that hangs cannot keep a robot rolling.

    Args:
        driver: only ever called from the thread.
        deadline_s: longest time that one call of the driver may take.
        silence_s: longest time between two orders.
    """

    def __init__(self, driver: Driver, deadline_s: float, silence_s: float) -> None:
        self._driver = driver
        self._deadline_s = deadline_s
        self._silence_s = silence_s
        self._changed = threading.Condition()
        # Everything below is guarded by the condition.
        self._order: _Order | None = None
        self._busy_since_s: float | None = None
        self._failure: str | None = None
        self._stopped = False
        self._checked_s: float | None = None
        self._slow_s = 0.0
        self._slow_since_s: float | None = None
        self._reading: OdometryReading | None = None
        self._thread = threading.Thread(target=self._run, name="wheels", daemon=True)
        self._thread.start()

    def turn(self, linear_mps: float, angular_radps: float) -> None:
        """Order a velocity; an order that was not taken yet gives way.

        Raises:
            DriverError: the driver has failed or hangs.
        """
        self._give(_Order(linear_mps, angular_radps))
        self.check(time.monotonic())

    def check(self, now_s: float) -> None:
        """Look after the driver, many times within its deadline.

        Only time in which this is called counts: a process that a busy machine held up, in the
        middle of a call, has no driver that hangs.

        Raises:
            DriverError: it has failed or hangs.
        """
        with self._changed:
            failure, busy_since_s = self._failure, self._busy_since_s
        if failure is not None:
            raise DriverError(f"driver failed: {failure}: check the board and its cable")
        if self._watched_s(busy_since_s, now_s) > self._deadline_s:
            raise DriverError(
                f"driver hangs: one call takes longer than {self._deadline_s:g} s: check the board "
                "and its cable, or raise --driver-deadline-s"
            )

    def _watched_s(self, busy_since_s: float | None, now_s: float) -> float:
        """For how long the present call has been seen to take."""
        if busy_since_s != self._slow_since_s:
            self._slow_since_s, self._slow_s = busy_since_s, 0.0
        since_s = max(busy_since_s or now_s, self._checked_s or now_s)
        self._slow_s += min(max(0.0, now_s - since_s), _LONGEST_GAP_S)
        self._checked_s = now_s
        return 0.0 if busy_since_s is None else self._slow_s

    def odometry(self) -> OdometryReading | None:
        """The newest reading that was not taken yet."""
        with self._changed:
            reading, self._reading = self._reading, None
        return reading

    def finish(self) -> bool:
        """Stop the wheels and close the driver; False if the last `stop` failed or hangs.

        Takes at most twice the deadline. Where the thread hangs in the driver, a last `stop` is
        tried from another one.
        """
        self._give(_END)
        self._thread.join(self._deadline_s)
        if self._thread.is_alive():
            last = threading.Thread(
                target=self._note_failure, args=(self._stop,), name="last-stop", daemon=True
            )
            last.start()
            last.join(self._deadline_s)
        with self._changed:
            return self._stopped

    def _give(self, order: _Order) -> None:
        with self._changed:
            self._order = order
            self._changed.notify_all()

    def _next(self) -> _Order:
        with self._changed:
            self._busy_since_s = None
            self._changed.wait_for(lambda: self._order is not None, self._silence_s)
            order, self._order = self._order or _STOP, None
            self._busy_since_s = time.monotonic()
        return order

    def _run(self) -> None:
        def turn_until_the_end() -> None:
            try:
                self._obey()
            finally:
                self._stop()
                self._driver.close()

        self._note_failure(turn_until_the_end)

    def _stop(self) -> None:
        self._driver.stop()
        with self._changed:
            self._stopped = True

    def _note_failure(self, action: Callable[[], None]) -> None:
        try:
            action()
        except Exception as error:  # reported by `check`: a driver is foreign code
            with self._changed:
                self._failure = f"{type(error).__name__}: {' '.join(str(error).split())}"[:200]

    def _obey(self) -> None:
        while not (order := self._next()).last:
            if order.linear_mps or order.angular_radps:
                self._driver.set_velocity(order.linear_mps, order.angular_radps)
            else:
                self._driver.stop()
            reading = self._driver.odometry()
            with self._changed:
                self._reading = reading or self._reading
