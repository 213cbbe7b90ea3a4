"""Identity by looks: galleries learn from people seen alone, and doubts settle.

Who is who after two people met is decided in contacts.py, who is back in recall.py.
"""

from __future__ import annotations

import math

import numpy as np

from heel.services.tracker.given_boxes.contacts import Contacts
from heel.services.tracker.given_boxes.frame import FrameBoxes
from heel.services.tracker.given_boxes.geometry import FloatArray, crowding
from heel.services.tracker.given_boxes.looks import LookModel
from heel.services.tracker.given_boxes.track import Track

_DOUBTED = 0.9
"""Identity confidence from which on a doubt is settled."""
_MOST_ALIKE = 3.0
"""Log odds by which another's descriptor can count for more than one's own; chosen by hand."""
_CROWD = 0.5
"""Share of its weight that a descriptor loses if its box is wholly overlapped."""
_ALIKE = 0.05
"""Odds that a person who is back is another missing person of the same colours."""
_ALIKE_AT_EDGE = 0.4
"""The same at the edge of the picture, where people come in; chosen by hand."""
CLEAR = 0.25
"""Overlap with other boxes up to which a descriptor is learned."""


class Identity:
    """Everything that is known of looks."""

    def __init__(self, reassure: float) -> None:
        """Start with nobody known.

        Args:
            reassure: how much colours settle a doubt, share of their log odds per second; 0: not.
        """
        self.model = LookModel()
        self._contacts = Contacts(self.model)
        self._reassure = reassure

    def open(self, track: Track) -> bool:
        """Whether it is not decided who this is."""
        return self._contacts.among(track)

    def log_odds(self, tracks: list[Track], boxes: FloatArray, looks: FloatArray) -> FloatArray:
        """Log odds (N, M) that (M, 4) boxes of (M, D) looks are of the tracks, less in a crowd."""
        weight = 1 - _CROWD * crowding(boxes)
        return self.model.compare([track.gallery for track in tracks], looks) * weight[None]

    def back(self, track: Track, look: FloatArray, missing: list[Track], at_edge: bool) -> float:
        """Probability that somebody who was out of sight is back, and not a known person alike.

        People come into view at its edges, so that there a place says little.

        Args:
            track: who is said to be back. look: (D,) of the box.
            missing: other known people who are out of sight. at_edge: whether the box is there.
        """
        if not missing:
            return 1.0
        everyone = [track, *missing]
        odds = self.model.compare([one.gallery for one in everyone], look[None])[:, 0]
        best = 1 + int(np.argmax(odds[1:]))
        prior = _ALIKE_AT_EDGE if at_edge else _ALIKE
        doubt = prior * math.exp(min(float(odds[best] - odds[0]), _MOST_ALIKE))
        return 1 / (1 + doubt)

    def reassure(
        self,
        pairs: list[tuple[Track, int]],
        known: list[Track],
        frame: FrameBoxes,
        elapsed_s: float,
    ) -> None:
        """Let looks settle a doubt that no meeting of two people keeps open.

        Looks of neighbouring frames are alike: those of a second count as one. What speaks for the
        person is by how much the look is more theirs than anybody else's who is known, so a twin
        settles nothing. What was learned since the doubt began does not speak: it may be another's.

        Looks raise no doubt here: who was seen all the time and turns round or crouches looks like
        somebody else at times. Doubts that did grow by it gave up five ids on PETS09-S2L1 with a
        network, four of them right.

        Args:
            pairs: tracks and the indices of their boxes.
            known: everybody in sight or remembered.
            frame: boxes and looks; without looks nothing is settled.
            elapsed_s: since the frame before.
        """
        if frame.looks is None:
            return
        alone = crowding(frame.boxes) <= CLEAR
        for track, j in pairs:
            if track.confidence >= _DOUBTED:
                track.vouched = None
            elif track.vouched is None:
                track.vouched = track.gallery.copy()
            if not (alone[j] and track.confirmed and self._is_doubted(track)):
                continue
            others = [one for one in known if one is not track and one.confirmed]
            galleries = [one.vouched or one.gallery for one in [track, *others]]
            odds = self.model.compare(galleries, frame.looks[j][None])[:, 0]
            evidence = max(float(odds[0]) - float(odds[1:].max(initial=0.0)), 0.0)
            doubt = (1 - track.confidence) / max(track.confidence, 1e-9)
            doubt *= math.exp(-self._reassure * min(evidence, _MOST_ALIKE) * elapsed_s)
            track.confidence = 1 / (1 + doubt)

    def _is_doubted(self, track: Track) -> bool:
        settles = self._reassure > 0
        return settles and track.confidence < _DOUBTED and not self._contacts.among(track)

    def learn(
        self,
        pairs: list[tuple[Track, int]],
        met: list[tuple[Track, Track]],
        known: set[int],
        frame: FrameBoxes,
        times_s: tuple[float, float],
    ) -> None:
        """Take in one frame.

        Args:
            pairs: tracks and the indices of their boxes.
            met: pairs of tracks that can be taken for each other.
            known: `id()` of every track in sight or remembered.
            frame: boxes and looks; without looks nothing is learned.
            times_s: now, and the time since the frame before.
        """
        if frame.looks is None:
            return
        t_s, elapsed_s = times_s
        for first, second in met:
            if first.confirmed and second.confirmed:
                self._contacts.touch(first, second, t_s)
        alone = crowding(frame.boxes) <= CLEAR
        clear = [(track, j) for track, j in pairs if alone[j]]
        tracks, looks = [track for track, _ in clear], frame.looks[[j for _, j in clear]]
        self._contacts.decide(tracks, looks, known, t_s, elapsed_s)
        # Who may be somebody else teaches nothing: the gallery is what settles it.
        decided = [k for k, track in enumerate(tracks) if not self._contacts.among(track)]
        self._remember([tracks[k] for k in decided], looks[decided])

    def _remember(self, tracks: list[Track], looks: FloatArray) -> None:
        known = [k for k, track in enumerate(tracks) if track.gallery.looks and track.confirmed]
        self.model.learn([tracks[k].gallery for k in known], looks[known])
        for track, look in zip(tracks, looks, strict=True):
            track.gallery.add(look)
