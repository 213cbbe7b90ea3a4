"""Tracking of people on given boxes: one call per frame, boxes in, tracks with identities out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from heel.schemas.errors import HeelError
from heel.services.tracker.given_boxes import kalman
from heel.services.tracker.given_boxes.association import (
    marginals,
    newcomer_log_density,
    pair_log_odds,
)
from heel.services.tracker.given_boxes.camera_motion import CameraMotion, shift_unseen
from heel.services.tracker.given_boxes.carry import CameraStep, Carrier
from heel.services.tracker.given_boxes.contacts import pairs_in_doubt
from heel.services.tracker.given_boxes.frame import FrameBoxes, checked
from heel.services.tracker.given_boxes.geometry import (
    AXES,
    FloatArray,
    covered_by,
    iou,
    measurements_to_boxes,
)
from heel.services.tracker.given_boxes.groups import (
    Merge,
    choose_merges,
    correct_merged,
    merge_candidates,
)
from heel.services.tracker.given_boxes.identity import Identity
from heel.services.tracker.given_boxes.newcomers import near_enough, newborn
from heel.services.tracker.given_boxes.recall import Recall
from heel.services.tracker.given_boxes.score_scale import ScoreScale
from heel.services.tracker.given_boxes.settings import BoxTrackerSettings
from heel.services.tracker.given_boxes.track import Track, TrackOutput

_EPSILON_S = 1e-6
_LEAST_WITNESSES = 2  # people whose surprises tell a motion of the camera from their own


class BoxTracker:
    """Kalman filtering and Kuhn-Munkres on boxes, with merged boxes, long memory and abstention.

    Online: what is returned for a frame depends on that frame and earlier ones alone.
    """

    def __init__(
        self,
        settings: BoxTrackerSettings | None = None,
        image_size: tuple[int, int] | None = None,
        next_id: int = 1,
    ) -> None:
        """Start with nobody.

        Args:
            settings: all numbers; defaults if None.
            image_size: (width, height) in pixels; without it nobody is known to have left.
            next_id: the first id to give out.
        """
        self.settings = settings or BoxTrackerSettings()
        self.next_id = next_id
        self._tracks: list[Track] = []
        self._identity = Identity(self.settings.appearance)
        self._recall = Recall(self.settings, self._identity.model, image_size)
        self._least_height_px = self.settings.life.least_height * (image_size or (0, 0))[1]
        self._carried = False
        self._carrier = Carrier()
        self._scale = ScoreScale()
        self._camera = CameraMotion(self.settings.camera, self.settings.motion)
        self._last_s: float | None = None

    def update(
        self,
        boxes: FloatArray,
        scores: FloatArray,
        t_s: float,
        looks: FloatArray | None = None,
        camera: CameraStep | None = None,
    ) -> list[TrackOutput]:
        """Take one frame's boxes and return every track that is alive and near.

        Args:
            boxes: (N, 4) xyxy pixels, in any order; those thinner than a pixel are left out.
            scores: (N,), any scale, more is surer.
            t_s: time of the frame in seconds, not before the last frame's.
            looks: (N, D) as of `appearance.describe`, or None without pictures.
            camera: how the picture moved since the frame before, where that is known.

        Raises:
            HeelError: a box or score is not finite, a box has no area, or time runs backwards.
        """
        if self._last_s is not None and not t_s >= self._last_s:
            raise HeelError(f"frame at {t_s} s after one at {self._last_s} s; sort frames by time")
        frame = checked(boxes, scores, looks)
        frame = replace(frame, scores=self._scale.normalised(frame.raw))
        frame = frame.select(frame.scores >= self.settings.life.keep_score)
        seen = frame.measurements()
        mean, covariance = self._predict(t_s, camera)
        pairs, merges, sure = self._associate(mean, covariance, frame, t_s)
        self._correct(pairs, seen, frame, sure, t_s)
        correct_merged(self._tracks, merges, frame.boxes, t_s, self.settings)
        self._learn(pairs, merges, sure, frame, t_s)
        self._miss({i for i, _ in pairs}, {i for merge in merges for i in merge.tracks})
        used = {j for _, j in pairs} | {merge.box for merge in merges}
        free = [j for j in range(len(frame.boxes)) if j not in used]
        self._tracks += newborn(frame, free, self._tracks, t_s, self.settings)
        self._deaths(t_s, pictures=looks is not None)
        self._confirm(t_s, pictures=looks is not None)
        return [
            track.output(t_s, self.settings.life, looks is not None, self._recall.at_side(track))
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
        least = self.settings.appearance.contact
        met = pairs_in_doubt(sure, pairs, least) + [merge.tracks for merge in merges]
        self._identity.reassure(
            [(self._tracks[i], j) for i, j in pairs],
            self._tracks + self._recall.lost,
            frame,
            self._elapsed_s,
        )
        self._identity.learn(
            [(self._tracks[i], j) for i, j in pairs],
            [(self._tracks[i], self._tracks[k]) for i, k in met],
            {id(track) for track in self._tracks + self._recall.lost},
            frame,
            (t_s, self._elapsed_s),
        )

    def _predict(self, t_s: float, camera: CameraStep | None) -> tuple[FloatArray, FloatArray]:
        elapsed_s = 0.0 if self._last_s is None else max(t_s - self._last_s, 0.0)
        self._last_s, self._elapsed_s = t_s, elapsed_s
        everyone = self._tracks + self._recall.lost
        if everyone:
            mean, covariance = kalman.predict(
                np.stack([track.mean for track in everyone]),
                np.stack([track.covariance for track in everyone]),
                elapsed_s,
                self.settings.motion,
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
        s, boxes, seen, looks = self.settings, frame.boxes, frame.measurements(), frame.looks
        if not self._tracks or len(boxes) == 0:
            return [], [], np.zeros((len(self._tracks), len(boxes)))
        exist = s.association.detection_rate * np.array([t.existence for t in self._tracks])
        rates = exist * (1 - s.association.hiding * self._hidden)
        log_odds = pair_log_odds(mean, covariance, rates, seen, s.association, s.motion)
        if looks is not None:
            log_odds += self._look_odds(boxes, looks, t_s)
        members = [
            k
            for k, track in enumerate(self._tracks)
            if track.confirmed and t_s - track.alone_s <= s.group.longest_s
        ]
        candidates = merge_candidates(
            members,
            measurements_to_boxes(mean[:, :, 0]),
            boxes,
            exist,
            newcomer_log_density(seen, s.association, s.motion),
            (s.group, s.association, s.motion),
        )
        pairs, merges, log_odds = choose_merges(log_odds, candidates)
        return pairs, merges, marginals(log_odds)

    def _look_odds(self, boxes: FloatArray, looks: FloatArray, t_s: float) -> FloatArray:
        """Log odds (N, M) of looks; who has just been seen and is not covered is not vetoed."""
        s = self.settings.appearance
        present = np.array(
            [
                track.confirmed
                and t_s - track.seen_s <= s.present_s + _EPSILON_S
                and hidden <= s.clear
                and not self._identity.open(track)
                for track, hidden in zip(self._tracks, self._hidden, strict=True)
            ]
        )
        against = np.where(present, s.most_against_present, s.most_against)
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
        variance = kalman.measurement_variance(mean[:, :, 0], self.settings.motion)
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
            if track.confirmed and not self._identity.open(track):
                away_s = 0.0 if pictures else t_s - track.seen_s
                if self._in_doubt(track, away_s, float(others.sum())):
                    track.track_id, track.confidence = self._new_id(), 1.0
            shared = 0.0
            if not track.confirmed and len(known):
                shared = float(iou(track.box()[None], known).max())
            track.believe(float(frame.scores[j]), shared, t_s, self.settings.life)

    def _sure_back(
        self, track: Track, frame: FrameBoxes, box: int, unseen: list[Track], t_s: float
    ) -> float:
        """Factor in [0, 1] on the confidence in a track that has got a box after time unseen."""
        if frame.looks is None:
            unseen_s = max(t_s - self._elapsed_s - track.seen_s, 0.0)
            return math.exp(-unseen_s / self.settings.life.doubt_s)
        if not track.confirmed or t_s - track.seen_s <= self.settings.life.away_s:
            return 1.0
        missing = self._recall.lost + [other for other in unseen if other.confirmed]
        at_edge = self._recall.at_edge(track)
        return self._identity.back(track, frame.looks[box], missing, at_edge)

    def _in_doubt(self, track: Track, away_s: float, rivals: float) -> bool:
        """Whether a box is no reason to go on with an id: rather a fresh one than a wrong one."""
        life = self.settings.life
        back = away_s > max(life.away_s, 1.5 * self._elapsed_s)
        return track.confidence < life.give_up or (back and rivals > life.rivals)

    def _miss(self, alone: set[int], merged: set[int]) -> None:
        rate = self.settings.association.detection_rate
        for index, track in enumerate(self._tracks):
            track.in_front = ()
            if index in alone:
                continue
            hiding = np.flatnonzero(self._covered[index] > self.settings.association.hidden)
            track.in_front = tuple(self._tracks[k] for k in hiding.tolist())
            if index in merged:
                continue
            track.missed_frames += 1
            if not track.confirmed:
                visible = rate * (1 - self._hidden[index])
                track.existence *= (1 - visible) / (1 - track.existence * visible)

    def _deaths(self, t_s: float, pictures: bool) -> None:
        life = self.settings.life
        recent_s = self.settings.appearance.recent_s if pictures else life.recent_s
        stay: list[Track] = []
        for track in self._tracks:
            unseen_s = t_s - track.seen_s - _EPSILON_S
            if unseen_s <= (recent_s if track.confirmed else life.tentative_s):
                stay.append(track)
            elif track.confirmed:
                self._recall.lose(track, pictures)
        self._tracks = stay
        self._recall.forget(t_s, pictures)

    def _confirm(self, t_s: float, pictures: bool) -> None:
        life, stands = self.settings.life, self._camera.stands()
        if stands and not self._carried:
            for track in self._tracks:
                track.walked = track.walked or track.walked_by() > life.walk
        near = [
            track
            for track in self._tracks
            if track.confirmed or near_enough(track, self._tracks, self._least_height_px, life)
        ]
        found = self._recall.recognised(near, t_s, stands, pictures)
        for newcomer, old, probability in found:
            newcomer.become(old, probability)
        known = {id(old) for _, old, _ in found}
        self._tracks = [track for track in self._tracks if id(track) not in known]
        self._recall.lost = [track for track in self._recall.lost if id(track) not in known]
        for track in near:
            if track.seen_s == t_s and track.ready(life):
                track.confirmed = True
                track.track_id = track.track_id or self._new_id()

    def _new_id(self) -> int:
        self.next_id += 1
        return self.next_id - 1
