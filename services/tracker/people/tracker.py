"""The people of a scene, one frame after the other: measurements in, tracks with identities out.

Each frame: every person is predicted; the front end measures whom it can; the filters are
corrected; contacts, returns and newcomers leave doubts about identities, which appearance settles;
whoever is unseen for long is remembered; new people are confirmed, or re-identified.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Generic

import numpy as np

from heel.schemas.errors import HeelError
from heel.services.geometry.boxes import iou_matrix
from heel.services.tracker.people import kalman
from heel.services.tracker.people.camera_motion import CameraMotion, shift_unseen
from heel.services.tracker.people.carry import CameraStep, Carrier
from heel.services.tracker.people.front_end import UNSEEN, Frame, FrontEnd, Scene
from heel.services.tracker.people.geometry import (
    AXES,
    covered_by,
    measurements_to_boxes,
)
from heel.services.tracker.people.identity import Identity
from heel.services.tracker.people.measured import Measured, Measurement
from heel.services.tracker.people.merged import correct_merged
from heel.services.tracker.people.recall import Recall
from heel.services.tracker.people.track import Track
from heel.services.tracker.people.tuning import Tuning
from heel.services.tracker.report import Report
from heel.services.tracker.trace import Cause, Event, Trace, probable

_EPSILON_S = 1e-6
"""Slack of comparisons of times [s], below any frame's."""
_LEAST_WITNESSES = 2
"""Fewest people whose innovations separate a motion of the camera from their own."""
_HIDDEN = 0.5
"""Covered share from which a missing person counts as hidden; chosen by hand."""
_WALK = 0.7
"""Distance from its birthplace from which a track has walked [heights]; chosen by hand."""
_TENTATIVE_S = 0.3
"""Time unseen after which a track that is not confirmed is dropped [s]; chosen by hand."""
_DOUBT_S = 10.0
"""Time out of sight in which the confidence in an identity falls to 1/e [s], appearance unknown;
chosen by hand."""
_GIVE_UP = 0.03
"""Identity confidence below which a track gets a fresh id; at 0.2 the pair of Couple is lost for
good in a second of doubt (on target 18.6 instead of 83.6 %), and TUD-Campus has wrong 1.9 instead
of 3.8 %."""
_AWAY_S = 0.2
"""Time unseen [s] after which the next measurement is a return, and less a failure of the detector;
chosen by hand."""


class PeopleTracker(Generic[Frame]):
    """Filters, identities, memory and lifecycle of all people, whatever measures them.

    Online: what is returned for a frame depends on that frame and earlier ones alone.
    """

    def __init__(
        self,
        front: FrontEnd[Frame],
        tuning: Tuning,
        image_size: tuple[int, int] | None = None,
        next_id: int = 1,
        trace: Trace | None = None,
    ) -> None:
        """Start without tracks.

        Args:
            front: measures people in frames.
            tuning: thresholds of the tracker.
            image_size: (width, height) in pixels; without it no track is known to have left.
            next_id: the first id to give out.
            trace: takes what is decided.
        """
        self._front = front
        self._tuning = tuning
        self.next_id = next_id
        self._tracks: list[Track] = []
        self._trace = trace or Trace()
        self._identity = Identity(tuning.reassure, self._trace)
        self._recall = Recall(self._identity.model, image_size, tuning.trust, self._trace)
        self._carrier = Carrier()
        self._camera = CameraMotion()
        self._carried = False
        self._last_s: float | None = None
        self._withheld: dict[str, int] = {}

    @property
    def withheld(self) -> str:
        """Why people that may be in the newest frame are not shown, and how many; "" for none."""
        reasons = [f"{count} not shown: {why}" for why, count in sorted(self._withheld.items())]
        return "; ".join([self._front.doubt] * bool(self._front.doubt) + reasons)

    def update(self, frame: Frame, t_s: float, camera: CameraStep | None = None) -> list[Report]:
        """Take one frame and return every track that is not lost.

        Args:
            frame: as the front end takes it.
            t_s: time of the frame in seconds, not before the last frame's.
            camera: motion of the picture since the frame before, where that is known.

        Raises:
            HeelError: time runs backwards, or as the front end says.
        """
        if self._last_s is not None and not t_s >= self._last_s:
            raise HeelError(f"frame at {t_s} s after one at {self._last_s} s; sort frames by time")
        scene = self._predict(t_s, camera)
        measured = self._front.measure(frame, scene)
        self._correct(measured, scene)
        correct_merged(measured.merges, t_s)
        self._identify(measured, scene)
        self._miss(measured, scene)
        self._bury(self._front.take_stock(self._tracks, measured, t_s), t_s)
        self._confirm(t_s)
        self._withheld = {}
        return [self._report(track, t_s) for track in self._tracks]

    def settle(self) -> None:
        """As `FrontEnd.settle`."""
        self._front.settle()

    def interrupt(self, next_id: int) -> None:
        """Take nobody's place for granted: all are out of sight, to be re-identified.

        Args:
            next_id: the next id to give out.
        """
        self.next_id = max(self.next_id, next_id)
        for track in self._tracks:
            if track.confirmed:
                self._recall.lose(track, self._front.pictures)
        self._tracks = []

    def _predict(self, t_s: float, camera: CameraStep | None) -> Scene:
        elapsed_s = 0.0 if self._last_s is None else max(t_s - self._last_s, 0.0)
        self._last_s = t_s
        everyone = self._tracks + self._recall.lost + self._identity.ahead()
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
        for track in self._tracks:
            track.predicted = track.mean, track.covariance
        self._tracks = [track for track in self._tracks if track.is_somewhere()]
        self._recall.lost = [track for track in self._recall.lost if track.is_somewhere()]
        mean = np.zeros((0, AXES, 2))
        covariance = np.zeros((0, AXES, 2, 2))
        if self._tracks:
            mean = np.stack([track.mean for track in self._tracks])
            covariance = np.stack([track.covariance for track in self._tracks])
        covered = covered_by(measurements_to_boxes(mean[:, :, 0]))
        return Scene(
            self._tracks, mean, covariance, covered, self._identity, t_s, elapsed_s, camera
        )  # fmt: skip

    def _correct(self, measured: Measured, scene: Scene) -> None:
        singles, t_s = measured.singles, scene.t_s
        if not singles:
            return
        tracks = [one.track for one in singles]
        seen = np.stack([one.value for one in singles])
        variance = np.stack([one.variance for one in singles])
        mean = np.stack([track.mean for track in tracks])
        covariance = np.stack([track.covariance for track in tracks])
        found = {id(track) for track in tracks}
        unseen = [track for track in self._tracks if id(track) not in found]
        self._guess_camera(singles, unseen, scene)
        mean, covariance = kalman.update(mean, covariance, seen, variance)
        for k, track in enumerate(tracks):
            track.mean, track.covariance = mean[k], covariance[k]
        known = np.array([t.box() for t in tracks if t.confirmed]).reshape(-1, 4)
        for one in singles:
            self._doubt(one, unseen, scene)
            track, shared = one.track, 0.0
            if not track.confirmed and len(known):
                shared = float(iou_matrix(track.box()[None], known).max())
            track.proven = track.proven or one.proven
            track.believe(one.score, shared, one.alone, t_s)

    def _guess_camera(
        self, singles: Sequence[Measurement], unseen: Sequence[Track], scene: Scene
    ) -> None:
        """Learn from surprises that people share whether the camera moves; `unseen` move along."""
        recent_s = scene.t_s - 1.5 * scene.elapsed_s
        steady = [one for one in singles if one.track.hits > 3 and one.track.seen_s > recent_s]
        mean = np.array([one.track.mean for one in steady]).reshape(-1, AXES, 2)
        surprise = np.array([one.value[:2] for one in steady]).reshape(-1, 2) - mean[:, :2, 0]
        if not self._carried:  # who is told how the camera moves need not guess
            self._camera.learn(surprise / np.exp(mean[:, 2, :1]))
        if len(steady) >= _LEAST_WITNESSES and not self._camera.stands():
            covariance = np.stack([one.track.covariance for one in steady])
            shift_unseen(unseen, surprise, covariance, np.stack([one.variance for one in steady]))

    def _doubt(self, one: Measurement, unseen: Sequence[Track], scene: Scene) -> None:
        """Lower the confidence in an identity by what a measurement leaves open."""
        track, pictures = one.track, self._front.pictures
        if one.told is not None:
            track.confidence = one.told
            return
        track.doubt(one.rivals, one.best, self._sure_back(one, unseen, scene))
        if not track.confirmed or self._identity.undecided(track):
            return
        away_s = 0.0 if pictures else scene.t_s - track.seen_s
        back = away_s > max(_AWAY_S, 1.5 * scene.elapsed_s)
        low = track.confidence < _GIVE_UP
        if low or (back and one.rivals > self._tuning.rivals):
            track.track_id = self._give_up(track, "confidence" if low else "return", one)
            track.confidence = 1.0

    def _sure_back(self, one: Measurement, unseen: Sequence[Track], scene: Scene) -> float:
        """Factor in [0, 1] on the confidence in a track that is measured after time unseen."""
        track = one.track
        if not self._front.pictures:
            unseen_s = max(scene.t_s - scene.elapsed_s - track.seen_s, 0.0)
            return math.exp(-unseen_s / _DOUBT_S)
        away = scene.t_s - track.seen_s > _AWAY_S
        track.returning = track.confirmed and (track.returning or away)
        if not track.returning or one.look is None:
            return 1.0
        track.returning = False
        missing = self._recall.lost + [other for other in unseen if other.confirmed]
        return self._identity.back(track, one.look, missing, self._recall.at_edge(track))

    def _identify(self, measured: Measured, scene: Scene) -> None:
        """Let appearance settle doubts, and learn the appearance of people in the clear."""
        if not self._front.pictures:
            return
        lost, times_s = self._recall.lost, (scene.t_s, scene.elapsed_s)
        self._identity.reassure(measured.singles, self._tracks + lost, scene.elapsed_s)
        for doubt in self._identity.learn(measured, (self._tracks, lost), times_s):
            fresh = self._give_up(doubt.track, "newcomer")
            person = doubt.track.part(fresh, doubt.galleries[0], scene.t_s)
            if doubt.person_is_known():
                self._recall.lose(person, pictures=True)

    def _miss(self, measured: Measured, scene: Scene) -> None:
        """Note who was not measured, and who stands in front of whom."""
        hidden = scene.hidden
        alone = {id(one.track) for one in measured.singles if one.alone}
        seen = alone | {id(one.track) for one in measured.singles}
        seen |= {id(track) for merge in measured.merges for track in merge.tracks}
        for index, track in enumerate(self._tracks):
            track.in_front = ()
            if id(track) in alone:
                continue
            hiding = np.flatnonzero(scene.covered[index] > _HIDDEN)
            track.in_front = tuple(self._tracks[k] for k in hiding.tolist())
            if id(track) in seen:
                continue
            track.missed_frames += 1
            if not track.confirmed:
                visible = self._front.detection_rate * (1 - hidden[index])
                track.existence *= (1 - visible) / (1 - track.existence * visible)

    def _bury(self, going_on: Sequence[Track], t_s: float) -> None:
        """Remember those of the tracks that do not go on, or are unseen for too long."""
        pictures = self._front.pictures
        recent_s = self._tuning.forget_known_s if pictures else self._tuning.forget_s
        stay = []
        for track in going_on:
            unseen_s = t_s - track.seen_s - _EPSILON_S
            if unseen_s <= (recent_s if track.confirmed else _TENTATIVE_S):
                stay.append(track)
        kept = {id(track) for track in stay}
        for track in self._tracks:
            if track.confirmed and id(track) not in kept:
                self._recall.lose(track, pictures)
        self._tracks = stay
        here = {track.track_id for track in stay}
        self._recall.lost = [track for track in self._recall.lost if track.track_id not in here]
        self._recall.forget(t_s, pictures)

    def _confirm(self, t_s: float) -> None:
        """Give ids to new people: those of before where they are re-identified, or fresh ones."""
        stands, pictures = self._camera.stands(), self._front.pictures
        if stands and not self._carried:
            for track in self._tracks:
                track.walked = track.walked or track.walked_by() > _WALK
        ready = [track for track in self._front.ready(self._tracks) if track.seen_s == t_s]
        claims = self._recall.recognised(ready, self._tracks, t_s, stands, pictures)
        found = [claim for claim in claims if claim.holds]
        for claim in found:
            self._trace.note(claim.event())
            claim.newcomer.become(claim.known, claim.probability)
            self._identity.go_on(claim.known, claim.newcomer)
        known = {id(claim.known) for claim in found}
        self._tracks = [track for track in self._tracks if id(track) not in known]
        self._recall.lost = [track for track in self._recall.lost if id(track) not in known]
        for track in ready:
            track.confirmed = True
            track.track_id = track.track_id or self._new_id()
            for other in self._front.parted(track, self._tracks):
                other.part(self._give_up(other, "newcomer"), other.gallery, t_s)
                self._identity.given_up(other)
        for claim in claims:
            if not claim.holds and claim.newcomer.track_id:
                self._trace.note(claim.event())

    def _report(self, track: Track, t_s: float) -> Report:
        at_side = self._recall.at_side(track)
        why = self._front.hides(track, t_s, at_side)
        if why and why != UNSEEN:
            self._withheld[why] = self._withheld.get(why, 0) + 1
        return track.report(t_s, self._front.pictures, not why)

    def _give_up(self, track: Track, cause: Cause, one: Measurement | None = None) -> int:
        """Note that a track's id is given up; the fresh one."""
        fresh, rival = self._new_id(), one.rival if one else None
        self._trace.note(
            Event("given up", id=track.track_id, other=fresh, cause=cause,
                  probability=probable(track.confidence),
                  runner_up=rival.track_id if rival else 0,
                  runner_up_probability=probable(track.runner_up) if one else None)
        )  # fmt: skip
        return fresh

    def _new_id(self) -> int:
        self.next_id += 1
        return self.next_id - 1
