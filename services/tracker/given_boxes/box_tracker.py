"""Tracking of people on given boxes: one call per frame, boxes in, tracks with identities out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from schemas.errors import HeelError
from services.tracker.given_boxes import kalman
from services.tracker.given_boxes.appearance import LookModel
from services.tracker.given_boxes.association import marginals, newcomer_log_density, pair_log_odds
from services.tracker.given_boxes.camera_motion import CameraMotion
from services.tracker.given_boxes.frame import FrameBoxes, checked
from services.tracker.given_boxes.geometry import (
    AXES,
    FloatArray,
    covered_share,
    crowding,
    iou,
    measurements_to_boxes,
)
from services.tracker.given_boxes.groups import (
    Merge,
    choose_merges,
    measure_members,
    merge_candidates,
)
from services.tracker.given_boxes.memory import claims
from services.tracker.given_boxes.score_scale import ScoreScale
from services.tracker.given_boxes.settings import BoxTrackerSettings
from services.tracker.given_boxes.track import Track, TrackOutput

_EPSILON_S = 1e-6
_UNKNOWN = 1e12  # variance factor of an axis that was not measured


class BoxTracker:
    """Kalman filtering and Kuhn-Munkres on boxes, with merged boxes, long memory and abstention.

    Online: what is returned for a frame depends on that frame and earlier ones alone.
    """

    def __init__(
        self,
        settings: BoxTrackerSettings | None = None,
        image_size: tuple[int, int] | None = None,
    ) -> None:
        """Start with nobody.

        Args:
            settings: all numbers; defaults if None.
            image_size: (width, height) in pixels; without it nobody is known to have left.
        """
        self.settings = settings or BoxTrackerSettings()
        self._image_size = image_size
        self._tracks: list[Track] = []
        self._lost: list[Track] = []
        self._looks = LookModel(self.settings.appearance)
        self._scale = ScoreScale()
        self._camera = CameraMotion(self.settings.camera, self.settings.motion)
        self._last_s: float | None = None
        self._next_id = 1

    def update(
        self, boxes: FloatArray, scores: FloatArray, t_s: float, looks: FloatArray | None = None
    ) -> list[TrackOutput]:
        """Take one frame's boxes and return every track that is alive and near.

        Args:
            boxes: (N, 4) xyxy pixels, in any order; those thinner than a pixel are left out.
            scores: (N,), any scale, more is surer.
            t_s: time of the frame in seconds, not before the last frame's.
            looks: (N, D) as of `appearance.describe`, or None without pictures.

        Raises:
            HeelError: a box or score is not finite, a box has no area, or time runs backwards.
        """
        if self._last_s is not None and not t_s >= self._last_s:
            raise HeelError(f"frame at {t_s} s after one at {self._last_s} s; sort frames by time")
        frame = checked(boxes, scores, looks)
        frame = replace(frame, scores=self._scale.normalised(frame.raw))
        frame = frame.select(frame.scores >= self.settings.life.keep_score)
        seen = frame.measurements()
        mean, covariance = self._predict(t_s)
        pairs, merges, sure = self._associate(mean, covariance, frame, t_s)
        self._correct(pairs, seen, frame.scores, sure, t_s)
        self._correct_merged(merges, frame.boxes, t_s)
        self._learn(pairs, frame)
        self._miss({i for i, _ in pairs} | {i for merge in merges for i in merge.tracks})
        used = {j for _, j in pairs} | {merge.box for merge in merges}
        self._births(frame, [j for j in range(len(frame.boxes)) if j not in used], t_s)
        self._deaths(t_s, pictures=looks is not None)
        self._confirm(t_s, pictures=looks is not None)
        return [track.output(t_s, self.settings.life) for track in self._tracks]

    def _learn(self, pairs: list[tuple[int, int]], frame: FrameBoxes) -> None:
        self._scale.learn(frame.raw[[j for i, j in pairs if self._tracks[i].hits > 2]])
        if frame.looks is not None:
            alone = crowding(frame.boxes) <= self.settings.appearance.clear
            clear = [(i, j) for i, j in pairs if alone[j]]
            tracks = [self._tracks[i] for i, _ in clear]
            self._looks.remember(tracks, frame.looks[[j for _, j in clear]])

    def _predict(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        elapsed_s = 0.0 if self._last_s is None else max(t_s - self._last_s, 0.0)
        self._last_s, self._elapsed_s = t_s, elapsed_s
        everyone = self._tracks + self._lost
        if not everyone:
            self._hidden = np.zeros(0)
            return np.zeros((0, AXES, 2)), np.zeros((0, AXES, 2, 2))
        mean, covariance = kalman.predict(
            np.stack([track.mean for track in everyone]),
            np.stack([track.covariance for track in everyone]),
            elapsed_s,
            self.settings.motion,
        )
        for k, track in enumerate(everyone):
            track.mean, track.covariance = mean[k], covariance[k]
        near = len(self._tracks)
        self._hidden = covered_share(measurements_to_boxes(mean[:near, :, 0]))
        return mean[:near], covariance[:near]

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
            weight = 1 - s.appearance.crowd * crowding(boxes)
            log_odds += self._looks.compare(self._tracks, looks) * weight[None]
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

    def _correct(
        self,
        pairs: list[tuple[int, int]],
        seen: FloatArray,
        scores: FloatArray,
        sure: FloatArray,
        t_s: float,
    ) -> None:
        if not pairs:
            return
        tracks = [self._tracks[i] for i, _ in pairs]
        boxes = [j for _, j in pairs]
        mean = np.stack([track.mean for track in tracks])
        recent_s = t_s - 1.5 * self._elapsed_s
        steady = [k for k, track in enumerate(tracks) if track.hits > 3 and track.seen_s > recent_s]
        surprise = (seen[boxes, :2] - mean[:, :2, 0]) / np.exp(mean[:, 2, :1])
        self._camera.learn(surprise[steady])
        variance = kalman.measurement_variance(mean[:, :, 0], self.settings.motion)
        covariance = np.stack([track.covariance for track in tracks])
        mean, covariance = kalman.update(mean, covariance, seen[boxes], variance)
        for k, track in enumerate(tracks):
            track.mean, track.covariance = mean[k], covariance[k]
        known = np.array([t.box() for t in tracks if t.confirmed]).reshape(-1, 4)
        for k, (i, j) in enumerate(pairs):
            track = tracks[k]
            rivals = float(sure[:, j].sum() - sure[i, j])
            unseen_s = max(t_s - self._elapsed_s - track.seen_s, 0.0)
            doubt = math.exp(-unseen_s / self.settings.life.doubt_s)
            track.confidence *= max(1 - rivals, 0.0) * doubt
            if track.confirmed and track.confidence < self.settings.life.give_up:
                track.track_id, track.confidence = self._new_id(), 1.0
            shared = 0.0
            if not track.confirmed and len(known):
                shared = float(iou(track.box()[None], known).max())
            track.believe(float(scores[j]), shared, t_s, self.settings.life)

    def _correct_merged(self, merges: list[Merge], boxes: FloatArray, t_s: float) -> None:
        s = self.settings
        for merge in merges:
            tracks = [self._tracks[i] for i in merge.tracks]
            mean = np.stack([track.mean for track in tracks])
            value = mean[:, :, 0].copy()
            variance = kalman.measurement_variance(value, s.motion)
            centre, factor = measure_members(
                measurements_to_boxes(value), boxes[merge.box], s.group.slack
            )
            value[:, :2] = centre
            variance[:, :2] *= np.minimum(factor, _UNKNOWN) * s.group.edge_noise**2
            variance[:, 2:] = _UNKNOWN
            covariance = np.stack([track.covariance for track in tracks])
            mean, covariance = kalman.update(mean, covariance, value, variance)
            for k, track in enumerate(tracks):
                track.mean, track.covariance = mean[k], covariance[k]
                track.see(t_s)

    def _miss(self, seen: set[int]) -> None:
        rate = self.settings.association.detection_rate
        for index, track in enumerate(self._tracks):
            if index in seen or track.confirmed:
                continue
            visible = rate * (1 - self._hidden[index])
            track.existence *= (1 - visible) / (1 - track.existence * visible)

    def _births(self, frame: FrameBoxes, free: list[int], t_s: float) -> None:
        life, boxes, scores = self.settings.life, frame.boxes, frame.scores
        seen = frame.measurements()
        taken = np.array([t.box() for t in self._tracks if t.seen_s == t_s]).reshape(-1, 4)
        for j in sorted(free, key=lambda index: -scores[index]):
            doubled = len(taken) and iou(boxes[j : j + 1], taken).max() > life.duplicate_iou
            if scores[j] < life.birth_score or doubled:
                continue
            mean, covariance = kalman.initial_state(seen[j : j + 1], self.settings.motion)
            self._tracks.append(Track.born(mean[0], covariance[0], float(scores[j]), t_s))
            taken = np.concatenate([taken, boxes[j : j + 1]])

    def _deaths(self, t_s: float, pictures: bool) -> None:
        life = self.settings.life
        recent_s = self.settings.appearance.recent_s if pictures else life.recent_s
        stay: list[Track] = []
        for track in self._tracks:
            unseen_s = t_s - track.seen_s - _EPSILON_S
            if unseen_s <= (recent_s if track.confirmed else life.tentative_s):
                stay.append(track)
            elif track.confirmed and not self._leaving(track):
                self._lost.append(track)
        self._tracks = stay
        remembered = [t for t in self._lost if t_s - t.seen_s <= life.memory_s]
        self._lost = remembered[-life.memory_size :]

    def _leaving(self, track: Track) -> bool:
        if self._image_size is None:
            return False
        box = track.box()
        inside = np.concatenate([box[:2], np.array(self._image_size) - box[2:]])
        return bool((inside < self.settings.life.edge * (box[2] - box[0])).any())

    def _confirm(self, t_s: float, pictures: bool) -> None:
        s = self.settings
        if self._camera.stands():
            for track in self._tracks:
                track.walked = track.walked or track.walked_by() > s.life.walk
        ready = [t for t in self._tracks if t.ready(s.life) and t.seen_s == t_s]
        looks: FloatArray | float = 0.0
        if pictures and ready and self._lost and all(t.look is not None for t in ready):
            looks = self._looks.compare(self._lost, np.array([t.look for t in ready]))
        lost = self._lost if self._camera.stands() else []
        for newcomer, old, probability in claims(ready, lost, looks, t_s, s.memory, s.motion):
            newcomer.track_id = old.track_id
            newcomer.confidence = old.confidence * probability
            self._lost = [track for track in self._lost if track is not old]
        for track in ready:
            track.confirmed = True
            if track.track_id == 0:
                track.track_id = self._new_id()

    def _new_id(self) -> int:
        self._next_id += 1
        return self._next_id - 1
