"""How often messages come, how much they carry, how old they are, which are missing. Pure."""

from __future__ import annotations

import statistics
from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from heel.services.commands.bus.message import Received, Told, kind_of
from heel.services.runtime.logs import printable

WINDOW_S = 5.0
"""Seconds that rates and ages are of: 125 frames of a camera; chosen by hand."""
_MOST_IN_WINDOW = 4096
"""Messages of one key that are remembered; chosen by hand, 50 a second for the whole window are
250."""
_MOST_KEYS = 256
"""Keys that are told apart, and senders of one: bounds the memory. Chosen by hand."""
_SILENT_INTERVALS = 4.0
"""A key is called silent after so many of its usual intervals; chosen by hand."""
_SILENT_S = 1.5
"""And after so many seconds; chosen by hand, above the second between two messages of health of the
slowest sender."""


@dataclass(slots=True)
class KeyRates:
    """What came on one key.

    Attributes:
        kind: name of the newest message's schema.
        count: messages since the beginning.
        bytes: payload bytes since the beginning.
        missing: messages that were never received, by gaps in their numbers.
        undecodable: messages that are none of Heel's.
        producers: senders by name, in the order of their first message.
    """

    kind: str = "?"
    count: int = 0
    bytes: int = 0
    missing: int = 0
    undecodable: int = 0
    producers: dict[str, None] = field(default_factory=dict)
    _arrivals: deque[tuple[float, int]] = field(
        default_factory=lambda: deque(maxlen=_MOST_IN_WINDOW)
    )
    _ages_s: deque[tuple[float, float]] = field(
        default_factory=lambda: deque(maxlen=_MOST_IN_WINDOW)
    )
    _newest: dict[tuple[str, int], int] = field(default_factory=dict)

    def hear(self, received: Received, told: Told | None) -> None:
        """A message came; `told` where it was looked into."""
        self.kind = kind_of(received.encoding) if told is None else told.kind
        self.count += 1
        self.bytes += received.size
        self._arrivals.append((received.arrived_s, received.size))
        if told is None:
            return
        self.undecodable += told.problem != ""
        if told.producer is not None and len(self.producers) < _MOST_KEYS:
            self.producers.setdefault(told.producer)
        if told.age_s is not None:
            self._ages_s.append((received.arrived_s, told.age_s))
        if told.counted is not None:
            self._count(*told.counted)

    def _count(self, producer: str, epoch: int, seq: int) -> None:
        newest = self._newest.get((producer, epoch))
        if newest is None and len(self._newest) >= _MOST_KEYS:
            self._newest.clear()
        if newest is not None and seq > newest:
            self.missing += seq - newest - 1
        self._newest[producer, epoch] = seq if newest is None else max(seq, newest)

    def intervals_s(self, now_s: float) -> list[float]:
        """Seconds between messages of the window."""
        times_s = [time_s for time_s, _ in self._arrivals if now_s - time_s <= WINDOW_S]
        return [later - earlier for earlier, later in pairwise(times_s)]

    def rate_hz(self, now_s: float) -> float:
        """Messages per second between the first and the newest of the window; 0 below two."""
        intervals = self.intervals_s(now_s)
        return len(intervals) / total if (total := sum(intervals)) > 0 else 0.0

    def bytes_per_s(self, now_s: float) -> float:
        """The rate times the mean size of the window's messages."""
        return self.rate_hz(now_s) * self.mean_bytes(now_s)

    def mean_bytes(self, now_s: float) -> float:
        """Mean payload of the window's messages."""
        sizes = [size for time_s, size in self._arrivals if now_s - time_s <= WINDOW_S]
        return statistics.fmean(sizes) if sizes else 0.0

    def largest_bytes(self) -> int:
        """The largest payload of those remembered."""
        return max((size for _, size in self._arrivals), default=0)

    def ages_s(self, now_s: float) -> list[float]:
        """Ages of the window's messages when they were sent."""
        return [age_s for time_s, age_s in self._ages_s if now_s - time_s <= WINDOW_S]

    def silent_s(self, now_s: float) -> float | None:
        """For how long nothing has come that is due; None while it comes as usual."""
        if not self._arrivals:
            return None
        since_s = now_s - self._arrivals[-1][0]
        times_s = [time_s for time_s, _ in self._arrivals]
        usual_s = statistics.median(b - a for a, b in pairwise(times_s)) if self.count > 1 else 0.0
        return since_s if since_s > max(_SILENT_S, _SILENT_INTERVALS * usual_s) else None


@dataclass(slots=True)
class BusRates:
    """What came on every key."""

    keys: dict[str, KeyRates] = field(default_factory=dict)
    unlisted: int = 0
    """Messages on further keys."""

    def hear(self, received: Received, told: Told | None = None) -> None:
        """A message came; `told` where it was looked into."""
        found = self.keys.get(received.key)
        if found is None:
            if len(self.keys) >= _MOST_KEYS:
                self.unlisted += 1
                return
            found = self.keys[received.key] = KeyRates()
        found.hear(received, told)

    def rows(self) -> list[tuple[str, KeyRates]]:
        """Every key with what came on it, by name."""
        return sorted(self.keys.items())


def hz_line(key: str, rates: KeyRates, now_s: float) -> str:
    """How often messages of one key come, as one line."""
    key = printable(key, 120)
    if (silent_s := rates.silent_s(now_s)) is not None:
        return f"{key}  silent for {silent_s:.1f} s, {rates.count} before"
    intervals = rates.intervals_s(now_s)
    if not intervals:
        return f"{key}  {rates.count} so far"
    words = [f"{rates.rate_hz(now_s):.1f}/s", f"every {statistics.fmean(intervals) * 1e3:.0f} ms "
             f"({min(intervals) * 1e3:.0f} to {max(intervals) * 1e3:.0f})"]  # fmt: skip
    if ages := rates.ages_s(now_s):
        words.append(f"{statistics.median(ages) * 1e3:.0f} ms old (at most {max(ages) * 1e3:.0f})")
    words.append(f"{rates.missing} missing")
    if rates.undecodable:
        words.append(f"{rates.undecodable} undecodable")
    if len(rates.producers) > 1:
        words.append(f"{len(rates.producers)} senders: {', '.join(rates.producers)}")
    return f"{key}  {', '.join(words)}"


def bw_line(key: str, rates: KeyRates, now_s: float) -> str:
    """How much messages of one key carry, as one line."""
    return (
        f"{printable(key, 120)}  {bytes_text(rates.bytes_per_s(now_s))}/s, "
        f"{bytes_text(rates.mean_bytes(now_s))} each (at most {bytes_text(rates.largest_bytes())})"
    )


def as_object(key: str, rates: KeyRates, now_s: float) -> dict[str, Any]:
    """All figures of one key, for `--json`."""
    intervals, ages = rates.intervals_s(now_s), rates.ages_s(now_s)
    return {
        "key": key,
        "kind": rates.kind,
        "producers": list(rates.producers),
        "count": rates.count,
        "rate_hz": round(rates.rate_hz(now_s), 3),
        "interval_ms_min": round(min(intervals) * 1e3, 3) if intervals else None,
        "interval_ms_max": round(max(intervals) * 1e3, 3) if intervals else None,
        "age_ms_p50": round(statistics.median(ages) * 1e3, 3) if ages else None,
        "age_ms_max": round(max(ages) * 1e3, 3) if ages else None,
        "bytes_per_s": round(rates.bytes_per_s(now_s)),
        "bytes_mean": round(rates.mean_bytes(now_s)),
        "bytes_max": rates.largest_bytes(),
        "missing": rates.missing,
        "undecodable": rates.undecodable,
        "silent_s": None if (silent := rates.silent_s(now_s)) is None else round(silent, 3),
    }


def bytes_text(size: float) -> str:
    """A number of bytes for people, in units of 1000."""
    for unit in ("B", "kB", "MB"):
        if size < 1000.0:
            return f"{size:.0f} B" if unit == "B" else f"{size:.3g} {unit}"
        size /= 1000.0
    return f"{size:.3g} GB"
