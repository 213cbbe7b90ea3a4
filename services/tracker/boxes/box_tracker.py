"""Tracking of people by given boxes: one call per frame, boxes in, tracks with identities out."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from heel.schemas.errors import HeelError
from heel.services.geometry.boxes import iou_matrix
from heel.services.tracker.boxes.association import (
    marginals,
    newcomer_log_density,
    pair_log_odds,
)
from heel.services.tracker.boxes.frame import FrameBoxes, checked
from heel.services.tracker.boxes.groups import (
    LONGEST_S,
    Merge,
    choose_merges,
    correct_merged,
    merge_candidates,
)
from heel.services.tracker.boxes.newcomers import near_enough, newborn
from heel.services.tracker.boxes.score_scale import ScoreScale
from heel.services.tracker.boxes.tuning import FILE, Tuning
from heel.services.tracker.people import kalman
from heel.services.tracker.people.camera_motion import CameraMotion, shift_unseen
from heel.services.tracker.people.carry import CameraStep, Carrier
from heel.services.tracker.people.contacts import pairs_in_doubt
from heel.services.tracker.people.geometry import (
    AXES,
    FloatArray,
    covered_by,
    measurements_to_boxes,
)
from heel.services.tracker.people.identity import CLEAR, Identity
from heel.services.tracker.people.looks import MOST_AGAINST
from heel.services.tracker.people.memory import Claim
from heel.services.tracker.people.recall import Recall
from heel.services.tracker.people.track import Track
from heel.services.tracker.report import Report
from heel.services.tracker.trace import Event, Trace, probable

_EPSILON_S = 1e-6
"""Slack of comparisons of times [s], below any frame's."""
_LEAST_WITNESSES = 2
"""Fewest people whose innovations separate a motion of the camera from their own."""
_KEEP_SCORE = 0.3
"""Least score of a box that is used at all, share of a usual person's; chosen by hand."""
_DETECTION_RATE = 0.75
"""Probability that a visible person gets a box; chosen by hand."""
_HIDING = 0.55
"""Share of the detection rate that is lost where another person covers the whole box; chosen by
hand."""
_HIDDEN = 0.5
"""Covered share from which a missing person counts as hidden; chosen by hand."""
_CONTACT = 0.02
"""Probability that a box is the other track's from which two tracks are in contact; chosen by
hand."""
_PRESENT_S = 0.25
"""Time without a box up to which a track counts as present [s]; chosen by hand."""
_WALK = 0.7
"""Distance from its birthplace from which a track has walked [heights]; chosen by hand."""
_TENTATIVE_S = 0.3
"""Time without a box after which a track that is not confirmed is dropped [s]; chosen by hand."""
_DOUBT_S = 10.0
"""Time out of sight in which the confidence in an identity falls to 1/e [s], appearance unknown;
chosen by hand."""
_GIVE_UP = 0.03
"""Identity confidence below which a track gets a fresh id; at 0.2 the pair of Couple is lost for
good in a second of doubt (on target 18.6 instead of 83.6 %), and TUD-Campus has wrong 1.9 instead
of 3.8 %."""
_AWAY_S = 0.2
"""Time without a box [s] after which the next box is a return, and less a failure of the detector;
chosen by hand."""


class BoxTracker:
    """Kalman filtering and Kuhn-Munkres on boxes, with merged boxes, long memory and abstention.

    Online: what is returned for a frame depends on that frame and earlier ones alone.
    """

    def __init__(
        self,
        tuning: Tuning = FILE,
        image_size: tuple[int, int] | None = None,
        next_id: int = 1,
        trace: Trace | None = None,
    ) -> None:
        """Start without tracks.

        Args:
            tuning: thresholds of the tracker.
            image_size: (width, height) in pixels; without it no track is known to have left.
            next_id: the first id to give out.
            trace: takes what is decided.
        """
        self._tuning = tuning
        self.next_id = next_id
        self._tracks: list[Track] = []
        self._trace = trace or Trace()
        self._identity = Identity(tuning.reassure, self._trace)
        self._recall = Recall(tuning, self._identity.model, image_size, self._trace)
        self._rows = (image_size or (0, 0))[1]
        self._carried = False
        self._carrier = Carrier()
        self._scale = ScoreScale()
        self._camera = CameraMotion()
        self._last_s: float | None = None

    def update(
        self,
        boxes: FloatArray,
        scores: FloatArray,
        t_s: float,
        looks: FloatArray | None = None,
        camera: CameraStep | None = None,
        proven: NDArray[np.bool_] | None = None,
    ) -> list[Report]:
        """Take one frame's boxes and return every track that is not lost.

        Args:
            boxes: (N, 4) xyxy pixels, in any order; those thinner than a pixel are left out.
            scores: (N,), any scale, more is surer.
            t_s: time of the frame in seconds, not before the last frame's.
            looks: (N, D) appearance descriptors of `appearance.describe`, or None without pictures.
            camera: motion of the picture since the frame before, where that is known.
            proven: (N,) whether a box is known to be on a person, not a thing; all if None.

        Raises:
            HeelError: a box or score is not finite, a box has no area, or time runs backwards.
        """
        if self._last_s is not None and not t_s >= self._last_s:
            raise HeelError(f"frame at {t_s} s after one at {self._last_s} s; sort frames by time")
        frame = checked(boxes, scores, looks, proven)
        frame = replace(frame, scores=self._scale.normalised(frame.raw))
        frame = frame.select(frame.scores >= _KEEP_SCORE)
        seen = frame.measurements()
        mean, covariance = self._predict(t_s, camera)
        pairs, merges, sure = self._associate(mean, covariance, frame, t_s)
        self._correct(pairs, seen, frame, sure, t_s)
        correct_merged(self._tracks, merges, frame.boxes, t_s)
        self._learn(pairs, merges, sure, frame, t_s)
        self._miss({i for i, _ in pairs}, {i for merge in merges for i in merge.tracks})
        used = {j for _, j in pairs} | {merge.box for merge in merges}
        free = [j for j in range(len(frame.boxes)) if j not in used]
        self._tracks += newborn(frame, free, self._tracks, t_s, self._tuning)
        self._deaths(t_s, pictures=looks is not None)
        self._confirm(t_s, pictures=looks is not None)
        return [
            track.report(
                t_s,
                self._tuning,
                looks is not None,
                self._recall.at_side(track),
                self._tuning.min_height * self._rows,
            )
            for track in self._tracks
        ]

    def _learn(
        self,
        pairs: list[tuple[int, int]],
        merges: list[Merge],
        sure: FloatArray,
        frame: FrameBoxes,
        t_s: float,
    ) -> None:
        self._scale.learn(frame.raw[[j for i, j in pairs if self._tracks[i].hits > 2]])
        met = pairs_in_doubt(sure, pairs, _CONTACT) + [merge.tracks for merge in merges]
        self._identity.reassure(
            [(self._tracks[i], j) for i, j in pairs],
            self._tracks + self._recall.lost,
            frame,
            self._elapsed_s,
        )
        refuted = self._identity.learn(
            [(self._tracks[i], j) for i, j in pairs],
            [(self._tracks[i], self._tracks[k]) for i, k in met],
            (self._tracks, self._recall.lost),
            frame,
            (t_s, self._elapsed_s),
        )
        for doubt in refuted:
            left = doubt.kept()
            person = doubt.track.part(self._new_id(), doubt.galleries[0], t_s)
            self._note_given_up(person.track_id, doubt.track.track_id, "newcomer", left)
            if doubt.person_is_known():
                self._recall.lose(person, pictures=True)

    def _predict(self, t_s: float, camera: CameraStep | None) -> tuple[FloatArray, FloatArray]:
        elapsed_s = 0.0 if self._last_s is None else max(t_s - self._last_s, 0.0)
        self._last_s, self._elapsed_s = t_s, elapsed_s
        everyone = self._tracks + self._recall.lost
        if everyone:
            mean, covariance = kalman.predict(
                np.stack([track.mean for track in everyone]),
                np.stack([track.covariance for track in everyone]),
                elapsed_s,
            )
            for k, track in enumerate(everyone):
                track.mean, track.covariance = mean[k], covariance[k]
                track.confidence_before = track.confidence
        if camera is not None:
            self._carried = True
            self._carrier.carry(everyone, camera, elapsed_s)
        self._tracks = [track for track in self._tracks if track.is_somewhere()]
        self._recall.lost = [track for track in self._recall.lost if track.is_somewhere()]
        if not self._tracks:
            self._covered, self._hidden = np.zeros((0, 0)), np.zeros(0)
            return np.zeros((0, AXES, 2)), np.zeros((0, AXES, 2, 2))
        mean = np.stack([track.mean for track in self._tracks])
        covariance = np.stack([track.covariance for track in self._tracks])
        self._covered = covered_by(measurements_to_boxes(mean[:, :, 0]))
        self._hidden = self._covered.max(axis=1)
        return mean, covariance

    def _associate(
        self,
        mean: FloatArray,
        covariance: FloatArray,
        frame: FrameBoxes,
        t_s: float,
    ) -> tuple[list[tuple[int, int]], list[Merge], FloatArray]:
        boxes, seen, looks = frame.boxes, frame.measurements(), frame.looks
        if not self._tracks or len(boxes) == 0:
            return [], [], np.zeros((len(self._tracks), len(boxes)))
        exist = _DETECTION_RATE * np.array([t.existence for t in self._tracks])
        rates = exist * (1 - _HIDING * self._hidden)
        log_odds = pair_log_odds(mean, covariance, rates, seen)
        if looks is not None:
            log_odds += self._look_odds(boxes, looks, t_s)
        members = [
            k
            for k, track in enumerate(self._tracks)
            if track.confirmed and t_s - track.alone_s <= LONGEST_S
        ]
        candidates = merge_candidates(
            members,
            measurements_to_boxes(mean[:, :, 0]),
            boxes,
            exist,
            newcomer_log_density(seen),
        )
        pairs, merges, log_odds = choose_merges(log_odds, candidates)
        return pairs, merges, marginals(log_odds)

    def _look_odds(self, boxes: FloatArray, looks: FloatArray, t_s: float) -> FloatArray:
        """Log odds (N, M) of appearance; they cannot refuse a box to a present, uncovered track."""
        present = np.array(
            [
                track.confirmed
                and t_s - track.seen_s <= _PRESENT_S + _EPSILON_S
                and hidden <= CLEAR
                and not self._identity.open(track)
                for track, hidden in zip(self._tracks, self._hidden, strict=True)
            ]
        )
        against = np.where(present, self._tuning.most_against_present, MOST_AGAINST)
        odds = self._identity.log_odds(self._tracks, boxes, looks)
        return np.asarray(np.maximum(odds, -against[:, None]))

    def _correct(
        self,
        pairs: list[tuple[int, int]],
        seen: FloatArray,
        frame: FrameBoxes,
        sure: FloatArray,
        t_s: float,
    ) -> None:
        if not pairs:
            return
        tracks, pictures = [self._tracks[i] for i, _ in pairs], frame.looks is not None
        boxes = [j for _, j in pairs]
        mean = np.stack([track.mean for track in tracks])
        recent_s = t_s - 1.5 * self._elapsed_s
        steady = [k for k, track in enumerate(tracks) if track.hits > 3 and track.seen_s > recent_s]
        surprise = seen[boxes, :2] - mean[:, :2, 0]
        self._camera.learn((surprise / np.exp(mean[:, 2, :1]))[steady])
        variance = kalman.measurement_variance(mean[:, :, 0])
        covariance = np.stack([track.covariance for track in tracks])
        found = {id(track) for track in tracks}
        unseen = [track for track in self._tracks if id(track) not in found]
        if len(steady) >= _LEAST_WITNESSES and not self._camera.stands():
            shift_unseen(unseen, surprise[steady], covariance[steady], variance[steady])
        mean, covariance = kalman.update(mean, covariance, seen[boxes], variance)
        for k, track in enumerate(tracks):
            track.mean, track.covariance = mean[k], covariance[k]
        known = np.array([t.box() for t in tracks if t.confirmed]).reshape(-1, 4)
        for k, (i, j) in enumerate(pairs):
            track = tracks[k]
            others = np.delete(sure[:, j], i)
            sure_back = self._sure_back(track, frame, j, unseen, t_s)
            track.doubt(float(others.sum()), float(others.max(initial=0.0)), sure_back)
            if track.confirmed and not self._identity.undecided(track):
                away_s = 0.0 if pictures else t_s - track.seen_s
                if self._in_doubt(track, away_s, float(others.sum())):
                    left, before = track.confidence, track.track_id
                    track.track_id, track.confidence = self._new_id(), 1.0
                    low = left < _GIVE_UP
                    self._note_given_up(
                        before, track.track_id, "confidence" if low else "return", left,
                        self._rival(sure[:, j], i), track.runner_up,
                    )  # fmt: skip
            shared = 0.0
            if not track.confirmed and len(known):
                shared = float(iou_matrix(track.box()[None], known).max())
            track.proven = track.proven or bool(frame.proven[j])
            track.believe(float(frame.scores[j]), shared, t_s)

    def _sure_back(
        self, track: Track, frame: FrameBoxes, box: int, unseen: list[Track], t_s: float
    ) -> float:
        """Factor in [0, 1] on the confidence in a track that has a box after time unseen."""
        if frame.looks is None:
            unseen_s = max(t_s - self._elapsed_s - track.seen_s, 0.0)
            return math.exp(-unseen_s / _DOUBT_S)
        if not track.confirmed or t_s - track.seen_s <= _AWAY_S:
            return 1.0
        missing = self._recall.lost + [other for other in unseen if other.confirmed]
        at_edge = self._recall.at_edge(track)
        return self._identity.back(track, frame.looks[box], missing, at_edge)

    def _in_doubt(self, track: Track, away_s: float, rivals: float) -> bool:
        """Whether a box leaves the id so uncertain that a fresh one is given."""
        back = away_s > max(_AWAY_S, 1.5 * self._elapsed_s)
        return track.confidence < _GIVE_UP or (back and rivals > self._tuning.rivals)

    def _miss(self, alone: set[int], merged: set[int]) -> None:
        for index, track in enumerate(self._tracks):
            track.in_front = ()
            if index in alone:
                continue
            hiding = np.flatnonzero(self._covered[index] > _HIDDEN)
            track.in_front = tuple(self._tracks[k] for k in hiding.tolist())
            if index in merged:
                continue
            track.missed_frames += 1
            if not track.confirmed:
                visible = _DETECTION_RATE * (1 - self._hidden[index])
                track.existence *= (1 - visible) / (1 - track.existence * visible)

    def _deaths(self, t_s: float, pictures: bool) -> None:
        recent_s = self._tuning.forget_known_s if pictures else self._tuning.forget_s
        stay: list[Track] = []
        for track in self._tracks:
            unseen_s = t_s - track.seen_s - _EPSILON_S
            if unseen_s <= (recent_s if track.confirmed else _TENTATIVE_S):
                stay.append(track)
            elif track.confirmed:
                self._recall.lose(track, pictures)
        self._tracks = stay
        self._recall.forget(t_s, pictures)

    def _confirm(self, t_s: float, pictures: bool) -> None:
        tuning, stands = self._tuning, self._camera.stands()
        if stands and not self._carried:
            for track in self._tracks:
                track.walked = track.walked or track.walked_by() > _WALK
        least_px = tuning.near_height * self._rows
        near = [
            track
            for track in self._tracks
            if track.confirmed or near_enough(track, self._tracks, least_px, tuning)
        ]
        claims = self._recall.recognised(near, t_s, stands, pictures)
        found = [claim for claim in claims if claim.holds]
        for claim in found:
            self._note_claim(claim)
            claim.newcomer.become(claim.known, claim.probability)
        known = {id(claim.known) for claim in found}
        self._tracks = [track for track in self._tracks if id(track) not in known]
        self._recall.lost = [track for track in self._recall.lost if id(track) not in known]
        for track in near:
            if track.seen_s == t_s and track.ready(tuning):
                track.confirmed = True
                track.track_id = track.track_id or self._new_id()
        for claim in claims:
            if not claim.holds and claim.newcomer.track_id:
                self._note_claim(claim)

    def _note_claim(self, claim: Claim) -> None:
        """Note a re-identification, or the person that a newcomer was compared with and is not."""
        if not self._trace.on:
            return
        if not claim.holds:
            event = Event(
                "new", id=claim.newcomer.track_id, probability=probable(claim.new_probability),
                runner_up=claim.known.track_id,
                runner_up_probability=probable(claim.probability),
            )  # fmt: skip
        else:
            other = claim.runner_up is not None
            other = other and claim.runner_up_probability > claim.new_probability
            event = Event(
                "re-identified", id=claim.known.track_id, other=claim.newcomer.track_id,
                probability=probable(claim.probability),
                runner_up=claim.runner_up.track_id if other and claim.runner_up else 0,
                runner_up_probability=probable(
                    claim.runner_up_probability if other else claim.new_probability
                ),
            )  # fmt: skip
        self._trace.note(event)

    def _note_given_up(
        self, old: int, new: int, cause: Literal["confidence", "return", "newcomer"], left: float,
        rival: int = 0, rival_probability: float | None = None,
    ) -> None:  # fmt: skip
        if self._trace.on:
            best = None if rival_probability is None else probable(rival_probability)
            self._trace.note(
                Event(
                    "given up",
                    id=old,
                    other=new,
                    cause=cause,
                    probability=probable(left),
                    runner_up=rival,
                    runner_up_probability=best,
                )
            )

    def _rival(self, sure: FloatArray, own: int) -> int:
        """Id of the track, beside `own`, that a box is most probably of; 0 for none."""
        others = np.delete(np.arange(len(sure)), own)
        if not len(others):
            return 0
        best = int(others[np.argmax(sure[others])])
        return self._tracks[best].track_id if sure[best] > 0 else 0

    def _new_id(self) -> int:
        self.next_id += 1
        return self.next_id - 1
