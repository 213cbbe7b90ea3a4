"""Summary of a run: `summary.json` for programs, and lines for the terminal."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from heel.services.detector.settings import DetectorSettings
from heel.services.models.store import identified
from heel.services.runtime.logs import printable

_CHAIN = ("detector", "tracker", "follower")
_LIBRARIES = ("heel-follow", "eclipse-zenoh", "opencv-python-headless", "numpy", "scipy", "msgpack",
              "pydantic")  # fmt: skip


@dataclass(frozen=True)
class Perception:
    """What figures rest on.

    Attributes:
        detector: which one ran.
        model: name of its network, or its file where that is not known by name; None for none.
        model_sha256: of that file, hexadecimal.
        model_near: the same of the second network, for every frame.
        model_near_sha256: of its file.
        tracker: preset.
    """

    detector: str
    model: str | None
    model_sha256: str | None
    model_near: str | None
    model_near_sha256: str | None
    tracker: str

    @classmethod
    def of(cls, detector: Mapping[str, Any], tracker: Mapping[str, Any]) -> Perception:
        """By the settings in force of both."""
        method = DetectorSettings.model_construct(None, **detector).method
        files = [detector.get(key) if method == "onnx" else None for key in ("model", "model_near")]
        first, second = map(_network, files)
        return cls(method, *first, *second, str(tracker.get("preset")))

    def __str__(self) -> str:
        seen = f"detector {self.detector}"
        for network, digest in (
            (self.model, self.model_sha256), (self.model_near, self.model_near_sha256),
        ):  # fmt: skip
            if network is not None:
                seen += f", network {network} (sha256 {(digest or 'unknown')[:12]})"
        return f"{seen}, tracker preset {self.tracker}"


def _network(file: str | None) -> tuple[str | None, str | None]:
    """Name, or file where it is not known by name, and sha256."""
    if file is None:
        return None, None
    try:
        name, digest = identified(Path(file))
    except OSError:
        return file, None
    return name or file, digest


@dataclass(frozen=True)
class Camera:
    """What the frames came from.

    Attributes:
        source: as text for people.
        fps: nominal frames per second.
        width, height: of its pictures before they are scaled, pixels: what `tracks.txt` is in.
    """

    source: str
    fps: float
    width: int
    height: int


@dataclass
class RunSummary:
    """Counters of a run, filled while it lasts."""

    mode: str
    captured: int = 0
    detected: int = 0
    tracked: int = 0
    commands: int = 0
    wall_s: float = 0.0
    ended: str = ""
    missing: dict[str, int] = field(default_factory=dict)
    """Frames that did not reach each service, by the gaps in its input."""
    malformed: dict[str, int] = field(default_factory=dict)
    restarts: dict[str, int] = field(default_factory=dict)
    """How often each service had to be started again."""
    cpu_s: dict[str, float] = field(default_factory=dict)
    peak_rss_mb: dict[str, float] = field(default_factory=dict)
    ages_ms: dict[str, list[float]] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)
    camera: Camera | None = None
    """What the frames came from; None as long as it is not known."""
    perception: Perception | None = None
    """What found and tracked people; None as long as it is not known."""

    def in_force(self, settings: dict[str, Any]) -> None:
        """Note the settings that the services say they have, by the name of their tables."""
        self.settings = settings
        if "detector" in settings and "tracker" in settings:
            self.perception = Perception.of(settings["detector"], settings["tracker"])

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
            "restarts": self.restarts,
            "wall_s": round(self.wall_s, 3),
            "fps": round(self.tracked / self.wall_s, 2) if self.wall_s > 0 else 0.0,
            "age_ms": {hop: percentiles(ages) for hop, ages in self.ages_ms.items()},
            "cpu_s": {name: round(value, 3) for name, value in self.cpu_s.items()},
            "peak_rss_mb": {name: round(value, 1) for name, value in self.peak_rss_mb.items()},
            "versions": {name: _version(name) for name in _LIBRARIES},
            "perception": None if self.perception is None else asdict(self.perception),
            "settings": self.settings,
            "camera": None if self.camera is None else asdict(self.camera),
        }  # fmt: skip

    def as_text(self) -> str:
        """The content of `summary.json`."""
        return json.dumps(self.as_json(), indent=2) + "\n"


def print_summary(summary: RunSummary, where: str) -> None:
    """Print frames, rate, drops, ages and, in the words given, where the files are."""
    # Paths and reasons are no markup, whatever brackets are in them.
    console = Console(highlight=False, soft_wrap=True, markup=False, emoji=False)
    rate = summary.tracked / summary.wall_s if summary.wall_s > 0 else 0.0
    console.print(
        f"{summary.captured} frames captured, {summary.detected} detected, {summary.tracked} "
        f"tracked in {summary.wall_s:.1f} s ({rate:.1f} frames/s); {printable(summary.ended)}"
    )
    if summary.perception is not None:
        console.print(printable(f"people by {summary.perception}"))
    lost = {name: count for name, count in summary.dropped().items() if count}
    if lost:
        console.print("dropped: " + ", ".join(f"{name} {count}" for name, count in lost.items()))
    if summary.restarts:
        again = ", ".join(f"{name} {count} times" for name, count in summary.restarts.items())
        console.print(f"started again: {again}: these figures are those of a run with faults")
    for hop, ages in summary.ages_ms.items():
        p = percentiles(ages)
        console.print(f"age at {hop}: median {p['median']:.1f} ms, p99 {p['p99']:.1f} ms")
    console.print(printable(where))


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
