"""The health message, sent from a thread of its own so that a hung loop is reported too."""

from __future__ import annotations

import datetime
import logging
import threading
import time

import zenoh

from heel.schemas import Health, encode, keys
from heel.schemas.base import Name
from heel.services.runtime import process, qos
from heel.services.runtime.certificate import days_left, ends_soon
from heel.services.runtime.chain import CERTIFICATE, CHAIN, MISSING
from heel.services.runtime.counters import ServiceStatistics
from heel.services.runtime.health_file import HealthFile
from heel.services.runtime.notify import Notifier
from heel.services.runtime.presence import Presence
from heel.services.runtime.shared_memory import SharedMemoryWatch

PERIOD_S = 0.25
"""So that silence is seen within a second; a message costs its sender half a millisecond."""
HUNG_S = 2.0
"""A service loop that has not come round for this long is reported as hung."""
START_S = 15.0
"""The same for a service that has yet to come round once: opening a source takes its time."""


class HealthReporter(threading.Thread):
    """Publishes a service's health four times a second until told to stop.

    Args:
        presence: tells whether the bus is there, and the other parts of the chain.
        notifier: lets `systemctl status` show the state, and is told that the process lives.
        certificate_until: end of this process's own certificate; None: it has none.
    """

    def __init__(
        self,
        session: zenoh.Session,
        service: Name,
        instance: Name,
        producer: str,
        statistics: ServiceStatistics,
        log: logging.Logger,
        file: HealthFile | None = None,
        presence: Presence | None = None,
        memory: SharedMemoryWatch | None = None,
        notifier: Notifier | None = None,
        certificate_until: datetime.datetime | None = None,
    ) -> None:
        super().__init__(name="health", daemon=True)
        if certificate_until is not None:
            statistics.certificates_until.append(certificate_until)
        self._notifier = notifier
        self._file, self._presence, self._memory = file, presence, memory
        self._service, self._instance, self._producer = service, instance, producer
        self._statistics = statistics
        self._log = log
        self._finishing = threading.Event()
        self._started_s = time.monotonic()
        self._state = "starting"
        self.newest: Health | None = None
        """The last message that was sent."""
        self._publisher = session.declare_publisher(
            keys.health(service, instance),
            priority=qos.HEALTH.priority,
            congestion_control=qos.HEALTH.congestion,
        )

    def run(self) -> None:
        """Publish until `finish`."""
        while not self._finishing.wait(PERIOD_S):
            if self._memory is not None:
                self._memory.look(time.monotonic())
            if self._notifier is not None:
                self._notifier.beside(time.monotonic())
            self._send(self.compose(time.monotonic()))

    def finish(self) -> None:
        """Publish a last message and end the thread."""
        self._finishing.set()
        self.join(timeout=1.0)
        self._send(self.compose(time.monotonic(), ended=True))

    def _send(self, health: Health) -> None:
        if health.state != self._state:
            if health.state != "ended":
                level = logging.INFO if health.state == "ok" else logging.WARNING
                self._log.log(level, "health: %s -> %s %s", self._state, health.state,
                              health.reason)  # fmt: skip
            self._state = health.state
        self.newest = health
        self._publisher.put(encode(health), encoding=Health.encoding())
        if self._notifier is not None:
            self._notifier.status(f"{health.state} {health.reason}")
        if self._file is not None and (failure := self._file.renew(health.state, health.reason)):
            self._log.warning("%s", failure)

    def compose(self, now_s: float, ended: bool = False) -> Health:
        """The health message of this moment."""
        s = self._statistics
        rate_in_hz, rate_out_hz = s.rates_hz(now_s)
        busy_ms, age_ms = s.busy_and_age_ms()
        rss_mb, peak_rss_mb = process.memory_mb()
        loop_age_s = now_s - (s.last_loop_s or self._started_s)
        problems = [*self._around(now_s), *s.problems(now_s)]
        if s.certificates_until:
            s.detail(CERTIFICATE, ends_soon(days_left(min(s.certificates_until))))
        hung = loop_age_s > (HUNG_S if s.last_loop_s else START_S)
        if hung:
            problems.insert(0, f"the service loop has hung for {loop_age_s:.1f} s: restart it")
        state = "degraded" if problems else "ok" if s.last_loop_s else "starting"
        return Health(
            service=self._service,
            instance=self._instance,
            producer=self._producer,
            state="ended" if ended else "error" if hung else state,
            reason="; ".join(problems)[:512],
            uptime_s=now_s - self._started_s,
            input_age_s=None if s.last_input_s is None else max(0.0, now_s - s.last_input_s),
            loop_age_s=max(0.0, loop_age_s),
            rate_in_hz=rate_in_hz,
            rate_out_hz=rate_out_hz,
            received=s.received,
            sent=s.sent,
            dropped=s.dropped,
            malformed=s.malformed,
            busy_ms_p50=busy_ms[0],
            busy_ms_p95=busy_ms[1],
            busy_ms_p99=busy_ms[2],
            age_ms_p50=age_ms[0],
            age_ms_p95=age_ms[1],
            age_ms_p99=age_ms[2],
            shared_memory=s.shared_memory,
            cpu_s=process.cpu_s(),
            rss_mb=rss_mb,
            peak_rss_mb=peak_rss_mb,
            software_version=process.software_version(),
            period_s=PERIOD_S,
            details=s.details_now(),
        )

    def _around(self, now_s: float) -> list[str]:
        """What is wrong around this service, the nearest cause first."""
        s = self._statistics
        found: list[str] = []
        if self._presence is not None:
            if self._presence.bus_away(now_s):
                # Then nothing comes in, and no other part can be judged.
                return ["the router is away"]
            missing = [] if s.input_over else self._presence.missing(now_s)
            s.detail(MISSING, ",".join(missing) or None)
            beside = neighbours(self._service)
            found += [f"{service}: gone" for service in missing if service in beside]
        if (missed := s.missed_input(now_s)) is not None:
            found.append(missed)
        return found


def neighbours(service: str) -> tuple[str, ...]:
    """The parts of the chain before and behind one."""
    if service not in CHAIN:
        return ()
    place = CHAIN.index(service)
    return CHAIN[max(0, place - 1) : place] + CHAIN[place + 1 : place + 2]
