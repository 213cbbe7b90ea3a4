"""What a tracker decides about identities, as events for a sink: a file, a log, a test.

Nothing of it flows back: with a sink or without, the tracks are the same. Events are rare: to make
one that nobody hears costs nothing that shows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from heel.schemas import Track
from heel.schemas.tracks import TrackState
from heel.services.colours import UNSURE_BELOW
from heel.services.tracker.report import Report
from heel.services.tracker.settings import Input

MOST_LOG_ODDS = 1e6
"""Largest size of log odds in an event: those of a pair that is refused."""
_SURE_FROM = 0.7
"""Identity confidence from which an id that was unsure is sure again: the follower's own default
for going on."""
_UNSEEN_S = 0.3
"""Time without a box of its own after which a track is noted as unseen [s]: above a detector's
usual gaps; chosen by hand."""

Kind = Literal[
    "input", "born", "confirmed", "unseen", "seen", "unsure", "sure", "gone", "forgotten",
    "contact", "decided", "assigned", "returned", "re-identified", "new", "given up",
    "verifying", "verified", "full",
]  # fmt: skip
Cause = Literal["confidence", "return", "newcomer"]
Probability = Annotated[float, Field(ge=0, le=1)]
LogOdds = Annotated[float, Field(ge=-MOST_LOG_ODDS, le=MOST_LOG_ODDS)]
_Count = Annotated[int, Field(ge=0, lt=2**63)]


@dataclass(frozen=True, slots=True)
class Event:
    """One decision about an identity, or one change of what is known of it.

    Attributes:
        kind: what happened.
        id: of the track that it is about, before the event; 0 for none.
        other: the second id: met, exchanged with, newcomer, or the id that the track goes on with.
        outcome: of a decision; "open" where it had to end without one.
        cause: why an id was given up: confidence too low, another track probable at the return,
            a newcomer from the same box.
        probability: of what was decided; of a track that is unsure, its identity confidence.
        runner_up: id of the next best answer; 0 for a person not known, or for none.
        runner_up_probability: of that answer.
        motion_log_odds, looks_log_odds: of a contact: that both tracks stayed with their people,
            by motion and by appearance descriptors.
        before_log_odds, split_log_odds: of a verification: that the track stayed with its person,
            by the gallery of before the newcomer and by that of the split.
        input: what the detector sends.
        method: which tracker works on it.
        frame: number from 1; 0 until the trace stamps it.
        t_s: capture time since the first frame of the trace [s].
    """

    __pydantic_config__ = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    kind: Kind
    id: _Count = 0
    other: _Count = 0
    outcome: Literal["kept", "exchanged", "open", "confirmed", "refuted"] | None = None
    cause: Cause | None = None
    probability: Probability | None = None
    runner_up: _Count = 0
    runner_up_probability: Probability | None = None
    motion_log_odds: LogOdds | None = None
    looks_log_odds: LogOdds | None = None
    before_log_odds: LogOdds | None = None
    split_log_odds: LogOdds | None = None
    input: Input | None = None
    method: Literal["evidence", "paper", "boxes", "pointed-at"] | None = None
    frame: _Count = 0
    t_s: float = 0.0


Sink = Callable[[Event], None]


class Trace:
    """Passes events on to sinks; without sinks it is off.

    Usage:
        trace = Trace(events.append)
        trace.begin(frame=1, t_s=0.0)
        trace.note(Event("contact", id=1, other=2))
    """

    def __init__(self, *sinks: Sink) -> None:
        """Start with these sinks, or none."""
        self._sinks = list(sinks)
        self._frame, self._t_s = 0, 0.0
        self._paused = False
        self.explained: set[int] = set()

    @property
    def on(self) -> bool:
        """Whether anybody listens."""
        return bool(self._sinks)

    def pause(self, paused: bool) -> None:
        """Pass nothing on for a while, or go on: what another tracker tells is not told twice."""
        self._paused = paused

    def add(self, sink: Sink) -> None:
        """Pass events on to one more sink."""
        self._sinks.append(sink)

    def begin(self, frame: int, t_s: float) -> None:
        """From here on events are of this frame, numbered from 1, at capture time `t_s`."""
        self._frame, self._t_s = frame, t_s

    def note(self, event: Event) -> None:
        """Pass an event on, if anybody listens."""
        if not self.on:
            return
        if event.kind in ("given up", "re-identified", "assigned"):
            self.explained |= {event.id, event.other}
        if self._paused:
            return
        stamped = replace(event, frame=self._frame, t_s=self._t_s)
        for sink in self._sinks:
            sink(stamped)

    @property
    def t_s(self) -> float:
        """Capture time of the frame that was begun last."""
        return self._t_s


@dataclass(slots=True)
class Known:
    """What was last noted of an id."""

    confirmed: bool = False
    unsure: bool = False
    unseen: bool = False
    seen_s: float = 0.0


class Changes:
    """Notes what changes from one frame's tracks to the next: of any tracker, by its output."""

    def __init__(self, trace: Trace) -> None:
        """Start without tracks."""
        self._trace = trace
        self._known: dict[int, Known] = {}

    def forget(self) -> None:
        """All tracks have been forgotten at once, as another scene begins."""
        for key in sorted(self._known):
            self._trace.note(Event("forgotten", id=key))
        self._known.clear()

    def observe(self, tracks: Sequence[Track] | Sequence[Report]) -> None:
        """Take in the tracks of a frame; does nothing while the trace is off."""
        if not self._trace.on:
            return
        present = {track.id for track in tracks if track.id}
        for key in sorted(self._known.keys() - present):
            del self._known[key]
            if key not in self._trace.explained:
                self._trace.note(Event("gone", id=key))
        for track in tracks:
            if track.id:
                self._observe(track)
        self._trace.explained.clear()

    def _observe(self, track: Track | Report) -> None:
        trace, state = self._trace, track.state
        known = self._known.get(track.id)
        if known is None:
            known = self._known[track.id] = Known(seen_s=trace.t_s)
            if state == "new":
                trace.note(Event("born", id=track.id))
        if not known.confirmed and state != "new":
            known.confirmed = True
            if track.id not in trace.explained:
                trace.note(Event("confirmed", id=track.id, probability=_confidence(track)))
        self._sight(track, known, state)
        confidence = _confidence(track)
        if known.confirmed and confidence < UNSURE_BELOW and not known.unsure:
            known.unsure = True
            trace.note(_doubt("unsure", track))
        elif known.unsure and confidence >= _SURE_FROM:
            known.unsure = False
            trace.note(_doubt("sure", track))

    def _sight(self, track: Track | Report, known: Known, state: TrackState) -> None:
        if state in ("new", "tracked"):
            known.seen_s = self._trace.t_s
            if known.unseen:
                known.unseen = False
                self._trace.note(Event("seen", id=track.id))
        elif not known.unseen and self._trace.t_s - known.seen_s >= _UNSEEN_S:
            known.unseen = True
            behind = track.occluded_by if isinstance(track, Track) else track.in_front
            occluder = next((key for key in behind if key), 0)
            self._trace.note(Event("unseen", id=track.id, other=occluder))


def _confidence(track: Track | Report) -> float:
    return probable(track.identity_confidence)


def _doubt(kind: Literal["unsure", "sure"], track: Track | Report) -> Event:
    return Event(
        kind, id=track.id, probability=_confidence(track),
        runner_up_probability=probable(track.runner_up_confidence),
    )  # fmt: skip


def probable(value: float) -> float:
    """A probability for an event: rounding may have led it beside [0, 1]."""
    return min(max(float(value), 0.0), 1.0)


def bounded(value: float) -> float:
    """Log odds for an event, within `MOST_LOG_ODDS`."""
    return min(max(float(value), -MOST_LOG_ODDS), MOST_LOG_ODDS)
