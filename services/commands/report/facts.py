"""What a report tells, whatever it was read from. Pure."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Box = tuple[float, float, float, float]
DOUBTS = ("unsure", "occluded", "searching", "lost")
"""States of the follower in which it does not see its person, or not surely."""
_NUMBER = re.compile(r"\d[\d.,]*")
_MOST_REASONS = 4
"""Of one span that are told; chosen by hand."""


@dataclass(frozen=True, slots=True)
class Span:
    """Something that lasted.

    Attributes:
        start_s, end_s: since the beginning of what is reported.
        name: state in one word.
        reason: why, in words.
    """

    start_s: float
    end_s: float
    name: str
    reason: str

    @property
    def length_s(self) -> float:
        """For how long."""
        return self.end_s - self.start_s


@dataclass(frozen=True, slots=True)
class Event:
    """Something that a tracker or a follower found out.

    Attributes:
        t_s: since the beginning.
        source: who said it: `follower` or `tracker`.
        kind: in a word or two.
        text: as a sentence.
        ids: of the tracks that it is about.
        frame: number from 1, None where it is not known.
    """

    t_s: float
    source: str
    kind: str
    text: str
    ids: tuple[int, ...] = ()
    frame: int | None = None


@dataclass(frozen=True, slots=True)
class Crop:
    """The target cut out of a picture.

    Attributes:
        t_s: since the beginning.
        track_id: of the target then.
        state: of the follower then.
        jpeg: the picture.
    """

    t_s: float
    track_id: int
    state: str
    jpeg: bytes


@dataclass(frozen=True, slots=True)
class Sighting:
    """Where the target was in a frame.

    Attributes:
        t_s: since the beginning.
        frame: that a picture is found by: its number, or epoch and number.
        track_id: of the target.
        box: xyxy pixels of a picture of that size.
        size: width and height of it; None: as the picture is.
        state: of the follower.
    """

    t_s: float
    frame: tuple[int, int]
    track_id: int
    box: Box
    size: tuple[int, int] | None
    state: str


@dataclass
class Curve:
    """A quantity over time; where it is not known there is NaN, or no sample.

    Attributes:
        name: for the legend.
        times_s: since the beginning, rising.
        values: one for each time.
    """

    name: str
    times_s: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)

    def add(self, t_s: float, value: float | None) -> None:
        """Take the next sample."""
        self.times_s.append(t_s)
        self.values.append(math.nan if value is None else value)

    @property
    def known(self) -> Reals:
        """The values without those that are not known."""
        values = np.array(self.values, np.float64)
        return values[np.isfinite(values)]

    def at(self, t_s: float) -> float | None:
        """The newest known value at a time; None before the first, or where it is not known."""
        index = int(np.searchsorted(self.times_s, t_s, side="right")) - 1
        if index < 0 or not math.isfinite(self.values[index]):
            return None
        return self.values[index]


@dataclass
class Facts:
    """All that is known of a run or a recording.

    Attributes:
        title: its name.
        kind: what it was read from, in words.
        duration_s: from its first to its last sign.
        notes: what is missing or wrong with it, in sentences.
        about: names and values that say what it is: source, software, detector, tracker.
        scores: names and values against the truth, if there is one.
        scored_by: what they were computed from.
        states: of the follower.
        wheels: what the drive did, where that is known.
        linear, angular: speeds, commanded first, m/s and rad/s.
        distances: to the target, and to the nearest person, m.
        confidences: that the target's track is on its person, and of the best other one.
        ages: of frames when each hop was done with them, ms.
        age_table: median, p95 and p99 of the same by hop, where only these are known.
        events: doubts and what led to them, by time.
        sightings: of the target, from which crops are chosen.
        crops: of the target.
        health: of services: name and words.
        settings: in force, by service.
        limits: settings that are drawn as lines in charts, by name.
    """

    title: str
    kind: str
    duration_s: float = 0.0
    notes: list[str] = field(default_factory=list)
    about: list[tuple[str, str]] = field(default_factory=list)
    scores: list[tuple[str, str]] = field(default_factory=list)
    scored_by: str = ""
    states: list[Span] = field(default_factory=list)
    wheels: list[Span] = field(default_factory=list)
    linear: list[Curve] = field(default_factory=list)
    angular: list[Curve] = field(default_factory=list)
    distances: list[Curve] = field(default_factory=list)
    confidences: list[Curve] = field(default_factory=list)
    ages: list[Curve] = field(default_factory=list)
    age_table: dict[str, dict[str, float]] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    sightings: list[Sighting] = field(default_factory=list)
    crops: list[Crop] = field(default_factory=list)
    health: list[tuple[str, str]] = field(default_factory=list)
    settings: dict[str, Any] = field(default_factory=dict)

    def limit(self, service: str, name: str) -> float | None:
        """A setting that is a number, None where it is not known."""
        table = self.settings.get(service)
        value = table.get(name) if isinstance(table, dict) else None
        return float(value) if isinstance(value, int | float) else None

    @property
    def stops(self) -> list[Span]:
        """When the wheels stood, by the drive's own word, else by what was commanded."""
        if self.wheels:
            return joined(span for span in self.wheels if span.name != "driving")
        return joined(standing(self.linear[:1], self.angular[:1], self.states))

    @property
    def targets(self) -> set[int]:
        """Everybody who was the target."""
        return {one.track_id for one in self.sightings}


def alike(one: str, other: str) -> bool:
    """Whether two reasons say the same but for their numbers."""
    return _NUMBER.sub("", one) == _NUMBER.sub("", other)


def joined(spans: Iterable[Span]) -> list[Span]:
    """Spans of one state in a row as one, with all its reasons that differ by more than numbers."""
    found: list[Span] = []
    reasons: list[str] = []
    for span in spans:
        if not found or found[-1].name != span.name or span.start_s > found[-1].end_s:
            found.append(span)
            reasons = [span.reason]
            continue
        if not any(alike(span.reason, known) for known in reasons):
            reasons.append(span.reason)
        told = "; ".join(reasons[:_MOST_REASONS])
        found[-1] = Span(found[-1].start_s, span.end_s, span.name, told)
    return found


class Spans:
    """Puts samples of a state together to what lasted."""

    def __init__(self) -> None:
        self.found: list[Span] = []
        self._open: tuple[float, str, str] | None = None

    def take(self, t_s: float, name: str, reason: str) -> None:
        """The state at a time, which is not before the one of the last call."""
        if self._open is not None and self._open[1:] == (name, reason):
            return
        self.end(t_s)
        self._open = (t_s, name, reason)

    def end(self, t_s: float) -> list[Span]:
        """What there was, the last one up to this time."""
        if self._open is not None:
            start_s, name, reason = self._open
            self.found.append(Span(start_s, t_s, name, reason))
            self._open = None
        return self.found


def standing(linear: list[Curve], angular: list[Curve], states: Sequence[Span]) -> list[Span]:
    """When zero was commanded, with the state and the reason of that moment."""
    if not linear or not angular:
        return []
    spans = Spans()
    index = 0
    for t_s, forward, turn in zip(
        linear[0].times_s, linear[0].values, angular[0].values, strict=True
    ):
        while index + 1 < len(states) and states[index + 1].start_s <= t_s:
            index += 1
        moves = bool(forward or turn)
        state = states[index] if states else Span(t_s, t_s, "", "")
        spans.take(t_s, "driving" if moves else state.name, "" if moves else state.reason)
    found = spans.end(linear[0].times_s[-1] if linear[0].times_s else 0.0)
    return [span for span in found if span.name != "driving"]


def doubts_of(states: Iterable[Span]) -> list[Event]:
    """What the follower says of each time in which it did not surely see its person."""
    return [
        Event(
            one.start_s, "follower", one.name, f"{one.name} for {one.length_s:.1f} s: {one.reason}"
        )
        for one in joined(states)
        if one.name in DOUBTS
    ]


def shares(states: Iterable[Span]) -> dict[str, float]:
    """Seconds spent in each state, the longest first."""
    total: dict[str, float] = {}
    for one in states:
        total[one.name] = total.get(one.name, 0.0) + one.length_s
    return dict(sorted(total.items(), key=lambda item: -item[1]))


def picked(sightings: Sequence[Sighting], times_s: Iterable[float], most: int) -> list[Sighting]:
    """Sightings to show: evenly over the time, and those nearest to some moments.

    Args:
        sightings: by time.
        times_s: moments that are of interest, the first ones first.
        most: that are chosen; half of them may go to those moments.
    """
    if not sightings:
        return []
    when = np.array([one.t_s for one in sightings])
    wanted: dict[int, None] = {}
    for t_s in times_s:
        if len(wanted) >= most // 2:
            break
        nearest = int(np.abs(when - t_s).argmin())
        wanted.setdefault(nearest)
    even = np.linspace(when[0], when[-1], most - len(wanted))
    for t_s in even:
        wanted.setdefault(int(np.abs(when - t_s).argmin()))
    return [sightings[index] for index in sorted(wanted)]


def way_m(linear: Curve) -> float:
    """Length of the way that a speed over time leads, m."""
    times_s, speeds = np.array(linear.times_s), np.nan_to_num(np.array(linear.values))
    # A gap longer than a second is one in the recording, not one that was driven through.
    steps_s = np.minimum(np.diff(times_s), 1.0)
    return float((np.abs(speeds[:-1]) * steps_s).sum()) if len(times_s) > 1 else 0.0
