"""Identities after a newcomer has come forth from a known person's box.

One box may have stood on two people for a while, of which the tracker knew one. At the split the
track stays with either of them, and no known rival shows the doubt. So once both are seen alone,
the descriptors of each are compared with two galleries: that of before, and that of the split,
which holds what the box has shown in between. If the newcomer fits either better than the track
does, nobody can say for whom the id was chosen, which may have been in between: it is given up.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from heel.services.geometry.boxes import cover_matrix
from heel.services.tracker.people.geometry import FloatArray
from heel.services.tracker.people.looks import Gallery, LookModel
from heel.services.tracker.people.track import Track
from heel.services.tracker.trace import Event, Trace, bounded, probable

_NEW_S = 2.0
"""Time since its first box for which a track is a newcomer [s]; between 0.7 and 4 s nothing changes
on recordings."""
_LEAST_HITS = 2
"""Boxes of a newcomer before it counts: a detector's slip comes once; chosen by hand."""
_KNOWN_LOOKS = 8
"""Descriptors from which a gallery is a person's; chosen by hand."""
_OVERLAP = 0.1
"""Share of either box in common from which a newcomer may have been in the other's; chosen by
hand."""
_FRAGMENT = 0.7
"""Share of the newcomer's box inside the other's from which it is a second box of the same person;
chosen by hand."""
_TOGETHER = 0.25
"""Share in common above which the two are not separate again; chosen by hand."""
_LEAST_LOOKS = 4
"""Descriptors of each before a decision; chosen by hand."""
_MOST_LOOKS = 128
"""Descriptors of each that count, the newest: a track that is never seen alone leaves a doubt open
for as long as its newcomer is in sight. Some seconds; chosen by hand."""
_INDEPENDENT = 4.0
"""Descriptors whose evidence adds up, as those of neighbouring frames are alike; chosen by hand."""
_PRIOR = 2.0
"""Log odds that a track has stayed with its person at such a split: 7 to 1; chosen by hand."""
_CONFIRMED = 4.0
"""Log odds of colours that confirm the identity; chosen by hand."""
_REFUTED = -8.0
"""Log odds of colours at which it is given up; chosen by hand."""
_SETTLE_S = 1.5
"""Time in clear view after which colours that cannot decide are believed no more [s]; chosen by
hand."""


Odds = deque[list[float]]
"""Log odds of descriptors by either gallery, the newest `_MOST_LOOKS`."""
_no_odds: partial[Odds] = partial(deque, maxlen=_MOST_LOOKS)


@dataclass
class Verification:
    """A track whose box a newcomer may have shared, and what speaks for its identity.

    Attributes:
        track: in doubt.
        galleries: of some time before and of the split.
        confidence: of before.
        newcomers: that overlapped with it.
        own: log odds of the track's descriptors since, by either gallery.
        theirs: the same of each newcomer.
        clear_s: time in which the track has been seen alone.
    """

    track: Track
    galleries: tuple[Gallery, Gallery]
    confidence: float
    newcomers: list[Track] = field(default_factory=list)
    own: Odds = field(default_factory=_no_odds)
    theirs: dict[Track, Odds] = field(default_factory=dict)
    clear_s: float = 0.0

    def evidence(self) -> tuple[float, float] | None:
        """Log odds, by either gallery, that it is of the track; None: not seen enough."""
        rivals = [np.mean(odds, axis=0) for odds in self.theirs.values() if _enough(odds)]
        if not rivals or not _enough(self.own):
            return None
        before, since = _INDEPENDENT * (np.mean(self.own, axis=0) - np.max(rivals, axis=0))
        return float(before), float(since)

    def person_is_known(self) -> bool:
        """Whether the id, once given up, is clearly of the person of before."""
        before, since = self.evidence() or (0.0, 0.0)
        return before <= _REFUTED and since < _CONFIRMED

    def kept(self) -> float:
        """Probability that the track has stayed with its person."""
        return self.confidence / (1 + math.exp(-_PRIOR - min(self.evidence() or (0.0,))))


class Verifications:
    """All tracks that are in doubt because of a newcomer."""

    def __init__(self, looks: LookModel, trace: Trace | None = None) -> None:
        """Start without doubts."""
        self._looks = looks
        self._trace = trace or Trace()
        self._open: dict[Track, Verification] = {}

    def open(self, track: Track) -> bool:
        """Whether a track is in doubt."""
        return track in self._open

    def close(self, track: Track) -> None:
        """Its id is given up: nothing is left to be verified."""
        self._open.pop(track, None)

    def keeps_from_learning(self, track: Track) -> bool:
        """Whether a descriptor may be another person's: it does not fit both galleries."""
        doubt = self._open.get(track)
        return doubt is not None and not (doubt.own and min(doubt.own[-1]) > 0)

    def note_newcomers(self, tracks: Sequence[Track], t_s: float) -> None:
        """Begin a verification of each known track that a newcomer overlaps.

        Args:
            tracks: all in sight. t_s: now.
        """
        self._drop(tracks)
        new = [track for track in tracks if _is_new(track, t_s)]
        if not new:
            return
        boxes = np.array([track.box() for track in new])
        for track in tracks:
            if not track.confirmed or track.gallery.looks < _KNOWN_LOOKS or track in new:
                continue
            shared = _shared(track.box()[None], boxes)
            for newcomer, share in zip(new, shared.tolist(), strict=True):
                if share > _OVERLAP:
                    self._note(track, newcomer, share)

    def decide(
        self, tracks: Sequence[Track], looks: FloatArray, elapsed_s: float
    ) -> list[Verification]:
        """Compare descriptors of tracks seen alone; close what is decided.

        Args:
            tracks: seen alone in this frame, and in no contact. looks: (N, D), their descriptors.
            elapsed_s: since the frame before.

        Returns:
            The verifications whose track is not its person any more.
        """
        refuted = []
        place = {id(track): k for k, track in enumerate(tracks)}
        for doubt in list(self._open.values()):
            doubt.track.confidence = min(doubt.track.confidence, doubt.kept())
            seen = [track for track in (doubt.track, *doubt.newcomers) if id(track) in place]
            if not seen or not self._compared(doubt, seen, looks[[place[id(t)] for t in seen]]):
                continue
            doubt.clear_s += elapsed_s
            evidence = min(doubt.evidence() or (0.0,))
            if evidence <= _REFUTED:
                refuted.append(doubt)
            elif evidence < _CONFIRMED and doubt.clear_s < _SETTLE_S:
                continue
            doubt.track.confidence = doubt.kept()
            del self._open[doubt.track]
            self._trace.note(_outcome(doubt, evidence))
        return refuted

    def _compared(self, doubt: Verification, seen: list[Track], looks: FloatArray) -> bool:
        """Note the odds of descriptors; whether the track in doubt is among those seen."""
        odds = self._looks.compare(list(doubt.galleries), looks).T.tolist()
        for track, value in zip(seen, odds, strict=True):
            own = track is doubt.track
            (doubt.own if own else doubt.theirs.setdefault(track, _no_odds())).append(value)
        return seen[0] is doubt.track

    def _note(self, track: Track, newcomer: Track, share: float) -> None:
        doubt = self._open.get(track)
        if doubt is None:
            now, before = track.gallery.copy(), track.gallery_before()
            known = before if before.looks >= _KNOWN_LOOKS else now
            doubt = Verification(track, (known, now), track.confidence)
            self._open[track] = doubt
            self._trace.note(Event("verifying", id=track.track_id, other=newcomer.track_id))
        elif share > _TOGETHER:
            doubt.own.clear()
            doubt.clear_s = 0.0
        if newcomer not in doubt.newcomers:
            doubt.newcomers.append(newcomer)

    def _drop(self, tracks: Sequence[Track]) -> None:
        """Forget tracks that have ended: without its newcomer a doubt has no ground."""
        known = set(tracks)
        for track, doubt in list(self._open.items()):
            doubt.newcomers = [one for one in doubt.newcomers if one in known]
            doubt.theirs = {one: odds for one, odds in doubt.theirs.items() if one in known}
            if track not in known or not doubt.newcomers:
                del self._open[track]
                left = probable(doubt.track.confidence)
                self._trace.note(
                    Event("verified", id=track.track_id, outcome="open", probability=left)
                )


def _outcome(doubt: Verification, evidence: float) -> Event:
    """What is noted of a verification that has ended."""
    before, since = doubt.evidence() or (0.0, 0.0)
    return Event(
        "verified", id=doubt.track.track_id, other=doubt.newcomers[0].track_id,
        outcome="refuted" if evidence <= _REFUTED else
        "confirmed" if evidence >= _CONFIRMED else "open",
        probability=probable(doubt.kept()),
        before_log_odds=bounded(before), split_log_odds=bounded(since),
    )  # fmt: skip


def _is_new(track: Track, t_s: float) -> bool:
    return track.hits >= _LEAST_HITS and (not track.confirmed or t_s - track.born_s <= _NEW_S)


def _enough(odds: Sequence[list[float]]) -> bool:
    return len(odds) >= _LEAST_LOOKS


def _shared(box: FloatArray, newcomers: FloatArray) -> FloatArray:
    """Largest share in common (N,) of a box (1, 4) and those of newcomers; 0 for its fragments."""
    inside = cover_matrix(newcomers, box)[:, 0]
    either = np.maximum(cover_matrix(box, newcomers)[0], inside)
    return np.asarray(np.where(inside > _FRAGMENT, 0.0, either))
