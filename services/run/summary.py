"""`summary.json`: what a run did, in figures that machines read."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from importlib import metadata
from typing import Any

import numpy as np

_CHAIN = ("detector", "tracker", "follower")
_LIBRARIES = ("heel-follow", "eclipse-zenoh", "opencv-python-headless", "numpy", "scipy", "msgpack",
              "pydantic")  # fmt: skip


@dataclass
class RunSummary:
    """Counters of a run, filled while it goes on."""

    mode: str
    captured: int = 0
    detected: int = 0
    tracked: int = 0
    commands: int = 0
    wall_s: float = 0.0
    ended: str = ""
    missing: dict[str, int] = field(default_factory=dict)
    """Frames that never reached each service, by the gaps in its input."""
    malformed: dict[str, int] = field(default_factory=dict)
    cpu_s: dict[str, float] = field(default_factory=dict)
    peak_rss_mb: dict[str, float] = field(default_factory=dict)
    ages_ms: dict[str, list[float]] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)

    def age(self, hop: str, age_s: float) -> None:
        """Note how old a frame was when a hop's result was sent."""
        self.ages_ms.setdefault(hop, []).append(age_s * 1e3)

    def dropped(self) -> dict[str, int]:
        """Frames lost by each service itself: a gap is not charged again further down the chain."""
        found = {"capture": self.missing.get("capture", 0)}
        upstream = 0
        for service in _CHAIN:
            missing = self.missing.get(service, 0)
            found[service] = max(0, missing - upstream)
            upstream = max(upstream, missing)
        return found

    def as_json(self) -> dict[str, Any]:
        """The object that is written."""
        return {
            "mode": self.mode,
            "ended": self.ended,
            "frames": {
                "captured": self.captured, "detected": self.detected, "tracked": self.tracked,
            },
            "commands": self.commands,
            "dropped": self.dropped(),
            "malformed": self.malformed,
            "wall_s": round(self.wall_s, 3),
            "fps": round(self.tracked / self.wall_s, 2) if self.wall_s > 0 else 0.0,
            "age_ms": {hop: percentiles(ages) for hop, ages in self.ages_ms.items()},
            "cpu_s": {name: round(value, 3) for name, value in self.cpu_s.items()},
            "peak_rss_mb": {name: round(value, 1) for name, value in self.peak_rss_mb.items()},
            "versions": {name: _version(name) for name in _LIBRARIES},
            "settings": self.settings,
        }  # fmt: skip

    def as_text(self) -> str:
        """The content of `summary.json`."""
        return json.dumps(self.as_json(), indent=2) + "\n"


def percentiles(values: Iterable[float]) -> dict[str, float]:
    """Median, p95 and p99, rounded to a hundredth."""
    median, p95, p99 = np.percentile(list(values), (50, 95, 99))
    return {"median": round(float(median), 2), "p95": round(float(p95), 2),
            "p99": round(float(p99), 2)}  # fmt: skip


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "unknown"
