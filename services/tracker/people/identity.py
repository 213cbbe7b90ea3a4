"""Identity by appearance: galleries learn from people seen alone, and doubts settle.

Which track is which person after two met is decided in contacts.py, after a newcomer came forth
from a known person's box in verification.py, and which one is back in recall.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from heel.services.tracker.people.appearance import DESCRIPTOR_LENGTH
from heel.services.tracker.people.contacts import Contacts
from heel.services.tracker.people.geometry import FloatArray, crowding
from heel.services.tracker.people.looks import LookModel
from heel.services.tracker.people.measured import Measured, Measurement
from heel.services.tracker.people.track import Track
from heel.services.tracker.people.verification import Verification, Verifications
from heel.services.tracker.trace import Event, Trace, probable

_DOUBTED = 0.9
"""Identity confidence from which a doubt is settled; chosen by hand."""
_MOST_ALIKE = 3.0
"""Most log odds that descriptors give for one person against another; chosen by hand."""
_CROWD = 0.5
"""Share of its weight that a descriptor loses if its box is wholly overlapped; chosen by hand."""
_ALIKE = 0.005
"""Odds that a person that is back is another missing person of the same colours, in spite of its
place: on recordings next to none was, even where colours fitted the other better by
`_MOST_ALIKE`."""
_ALIKE_AT_EDGE = 0.05
"""The same odds at the edge of the picture, where people come in; from recordings, too."""
CLEAR = 0.25
"""Covered or shared part of a box up to which the person is seen alone; chosen by hand."""


class Identity:
    """Appearance model, and the contacts that it is to decide."""

    def __init__(self, reassure: float, trace: Trace | None = None) -> None:
        """Start without galleries.

        Args:
            reassure: weight of colours in settling a doubt, share of their log odds per second; 0:
                they settle none.
            trace: takes what is decided.
        """
        self.model = LookModel()
        self._trace = trace or Trace()
        self._contacts = Contacts(self.model, self._trace)
        self._verifications = Verifications(self.model, self._trace)
        self._reassure = reassure

    def open(self, track: Track) -> bool:
        """Whether a contact with a known person leaves the identity of a track undecided."""
        return self._contacts.among(track)

    def ahead(self) -> list[Track]:
        """Copies of people in contact that go on from before it, to be predicted with tracks."""
        return self._contacts.ahead()

    def undecided(self, track: Track) -> bool:
        """Whether a contact or a newcomer leaves the identity of a track undecided."""
        return self.open(track) or self._verifications.open(track)

    def go_on(self, known: Track, newcomer: Track) -> None:
        """A track is taken to be a known person's, who is back."""
        self._contacts.go_on(known, newcomer)

    def given_up(self, track: Track) -> None:
        """The id of a track has been given up for another reason than a newcomer's descriptors."""
        self._verifications.close(track)

    def log_odds(self, tracks: Sequence[Track], boxes: FloatArray, looks: FloatArray) -> FloatArray:
        """Log odds (N, M) that (M, 4) boxes with (M, D) descriptors are of the tracks.

        Overlap with other boxes lowers their weight.
        """
        weight = 1 - _CROWD * crowding(boxes)
        return self.model.compare([track.gallery for track in tracks], looks) * weight[None]

    def back(self, track: Track, look: FloatArray, missing: list[Track], at_edge: bool) -> float:
        """Probability that a return is of this track, not of another missing person alike.

        People come into view at the edges of the picture, so that a place there is weak evidence.

        Args:
            track: back after time out of sight. look: (D,) descriptor of the box.
            missing: other known tracks that are out of sight. at_edge: whether the box is at one.
        """
        if not missing:
            return 1.0
        everyone = [track, *missing]
        odds = self.model.compare([one.gallery for one in everyone], look[None])[:, 0]
        best = 1 + int(np.argmax(odds[1:]))
        prior = _ALIKE_AT_EDGE if at_edge else _ALIKE
        doubt = prior * math.exp(min(float(odds[best] - odds[0]), _MOST_ALIKE))
        same = 1 / (1 + doubt)
        self._trace.note(
            Event("returned", id=track.track_id, probability=probable(same),
                  runner_up=everyone[best].track_id, runner_up_probability=probable(1 - same))
        )  # fmt: skip
        return same

    def reassure(
        self,
        measurements: Sequence[Measurement],
        known: list[Track],
        elapsed_s: float,
    ) -> None:
        """Let appearance settle a doubt that no contact keeps open.

        Descriptors of neighbouring frames are alike: those of a second count as one. The evidence
        is the log odds of the track less those of the best other known track, so that a twin
        settles nothing. The gallery is that of before the doubt: later descriptors may be another
        person's.

        Appearance raises no doubt here: a person in sight all the time that turns round or crouches
        resembles another one at times, and would lose a right id.

        Args:
            measurements: of tracks by themselves; those without a descriptor settle nothing.
            known: all tracks in sight or remembered.
            elapsed_s: since the frame before.
        """
        for one in measurements:
            track = one.track
            if track.confidence >= _DOUBTED:
                track.vouched = None
            elif track.vouched is None:
                track.vouched = track.gallery.copy()
            if one.look is None or not one.clear or not track.confirmed:
                continue
            if not self._is_doubted(track):
                continue
            others = [other for other in known if other is not track and other.confirmed]
            galleries = [other.vouched or other.gallery for other in [track, *others]]
            odds = self.model.compare(galleries, one.look[None])[:, 0]
            evidence = max(float(odds[0]) - float(odds[1:].max(initial=0.0)), 0.0)
            doubt = (1 - track.confidence) / max(track.confidence, 1e-9)
            doubt *= math.exp(-self._reassure * min(evidence, _MOST_ALIKE) * elapsed_s)
            track.confidence = 1 / (1 + doubt)

    def _is_doubted(self, track: Track) -> bool:
        settles = self._reassure > 0
        return settles and track.confidence < _DOUBTED and not self._contacts.among(track)

    def learn(
        self,
        measured: Measured,
        tracks: tuple[list[Track], list[Track]],
        times_s: tuple[float, float],
    ) -> list[Verification]:
        """Take in one frame, of which pictures are known.

        Args:
            measured: tracks, their descriptors, and pairs that can be confused.
            tracks: all in sight, and all remembered.
            times_s: now, and the time since the frame before.

        Returns:
            Identities to be given up: the track may be of a newcomer by now.
        """
        t_s, elapsed_s = times_s
        for first, second in measured.met:
            if first.confirmed and second.confirmed:
                self._contacts.touch(first, second, t_s)
        clear = [one for one in measured.singles if one.clear and one.look is not None]
        seen = [one.track for one in clear]
        looks = np.array([one.look for one in clear]).reshape(len(clear), DESCRIPTOR_LENGTH)
        known = {id(track) for group in tracks for track in group}
        self._contacts.decide(clear, looks, known, t_s, elapsed_s)
        # A track that may be another person's adds nothing: its gallery is to decide that.
        decided = [k for k, track in enumerate(seen) if not self._contacts.among(track)]
        self._verifications.note_newcomers(tracks[0], t_s)
        refuted = self._verifications.decide([seen[k] for k in decided], looks[decided], elapsed_s)
        sure = [k for k in decided if not self._verifications.keeps_from_learning(seen[k])]
        self._remember([seen[k] for k in sure], looks[sure], t_s)
        return refuted

    def _remember(self, tracks: list[Track], looks: FloatArray, t_s: float) -> None:
        known = [k for k, track in enumerate(tracks) if track.gallery.looks and track.confirmed]
        self.model.learn([tracks[k].gallery for k in known], looks[known])
        for track, look in zip(tracks, looks, strict=True):
            track.remember(look, t_s)
