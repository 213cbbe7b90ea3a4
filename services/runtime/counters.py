"""Counters and timings of one service, and what they mean for its health."""

from __future__ import annotations

import datetime
import math
import threading
from collections import deque
from dataclasses import dataclass, field

import numpy as np

_WINDOW = 256
"""Latest values that percentiles are of; chosen by hand."""
_RATE_WINDOW_S = 2.0
"""Seconds that a rate is the mean of; chosen by hand."""
_INTERVALS = 8
"""Latest arrivals that the usual interval is told from; chosen by hand."""
_SILENT_S = 0.75
"""An input that was there is missed after this, or after three of its usual intervals."""
_SENDERS = {"image": "capture", "blobs": "detector", "tracks": "tracker", "command": "follower",
            "drive": "drive"}  # fmt: skip


@dataclass(slots=True)
class _Rate:
    """Events per second over the last two seconds."""

    times_s: deque[float] = field(default_factory=lambda: deque(maxlen=1024))

    def hit(self, now_s: float) -> None:
        self.times_s.append(now_s)

    def interval_s(self) -> float:
        """Mean time between the last eight events; 0 before the second."""
        newest = list(self.times_s)[-_INTERVALS:]
        return (newest[-1] - newest[0]) / (len(newest) - 1) if len(newest) > 1 else 0.0

    def per_second(self, now_s: float) -> float:
        return sum(1 for t in self.times_s if now_s - t <= _RATE_WINDOW_S) / _RATE_WINDOW_S


class ServiceStatistics:
    """Written by the service loop, read by the health thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._in = _Rate()
        self._out = _Rate()
        self._busy_ms: deque[float] = deque(maxlen=_WINDOW)
        self._age_ms: deque[float] = deque(maxlen=_WINDOW)
        self._problems: dict[str, tuple[str, float]] = {}
        self.received = self.sent = self.dropped = self.malformed = 0
        self.failed = 0
        """Messages that could not be processed."""
        self.last_input_s: float | None = None
        self.last_loop_s: float | None = None
        self.shared_memory: bool | None = None
        self.details: dict[str, str] = {}
        self.certificates_until: list[datetime.datetime] = []
        """Ends of the certificates that this process rests on."""
        self.input_topic: str | None = None
        """The stream that `input` counts and that is missed when it falls silent."""
        self.input_over = False
        """Whether that stream has announced its end."""

    def loop(self, now_s: float) -> None:
        """The service loop came round."""
        self.last_loop_s = now_s

    def input(self, now_s: float) -> None:
        """A good input arrived."""
        with self._lock:
            self.received += 1
            self.last_input_s = now_s
            self.input_over = False
            self._in.hit(now_s)

    def output(self, now_s: float, busy_s: float, age_s: float) -> None:
        """A result was sent, after `busy_s` of work, for a frame `age_s` old."""
        with self._lock:
            self.sent += 1
            self._out.hit(now_s)
            self._busy_ms.append(busy_s * 1e3)
            self._age_ms.append(age_s * 1e3)

    def problem(self, kind: str, reason: str | None, until_s: float = math.inf) -> bool:
        """Report or clear (None) a lasting problem; True if that is news.

        Args:
            kind: what the problem is with; another reason for the same takes its place.
            reason: in words.
            until_s: monotonic time at which it is over unless it is reported again.
        """
        with self._lock:
            if reason is None:
                return self._problems.pop(kind, None) is not None
            news = kind not in self._problems or self._problems[kind][0] != reason
            self._problems[kind] = reason, until_s
            return news

    def missed_input(self, now_s: float) -> str | None:
        """What to say of an input that came and comes no more; None while all is well."""
        with self._lock:
            last_s, usual_s = self.last_input_s, self._in.interval_s()
        if self.input_topic is None or last_s is None or self.input_over:
            return None
        silent_s = now_s - last_s
        if silent_s <= max(_SILENT_S, 3.0 * usual_s):
            return None
        sender = _SENDERS.get(self.input_topic)
        remedy = f": is {sender} running?" if sender else ""
        return f"no {self.input_topic} for {max(1.0, silent_s):.0f} s{remedy}"

    def problems(self, now_s: float = -math.inf) -> list[str]:
        """Reasons of all problems that last."""
        with self._lock:
            self._problems = {
                kind: (reason, until_s)
                for kind, (reason, until_s) in self._problems.items()
                if now_s < until_s
            }
            return [reason for reason, _ in self._problems.values()]

    def detail(self, name: str, value: str | None) -> None:
        """Set a detail of the health message, or take it out (None)."""
        with self._lock:
            if value is None:
                self.details.pop(name, None)
            else:
                self.details[name] = value

    def details_now(self) -> dict[str, str]:
        """A copy of the details."""
        with self._lock:
            return dict(self.details)

    def rates_hz(self, now_s: float) -> tuple[float, float]:
        """Inputs and outputs per second."""
        with self._lock:
            return self._in.per_second(now_s), self._out.per_second(now_s)

    def busy_and_age_ms(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """p50, p95 and p99 of both over the last 256 results; zeros before the first."""
        with self._lock:
            return _percentiles(self._busy_ms), _percentiles(self._age_ms)


def _percentiles(values: deque[float]) -> tuple[float, ...]:
    if not values:
        return (0.0, 0.0, 0.0)
    return tuple(max(0.0, float(p)) for p in np.percentile(list(values), (50, 95, 99)))
